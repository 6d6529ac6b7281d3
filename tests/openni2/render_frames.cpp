// render_frames SCENE SEED WIDTH HEIGHT COUNT RAW OUT: frames for the test driver, rendered beforehand (RAW 1: also
// depth as a depth camera 25 mm to the left sees it). Does nothing when OUT is there already.
#include <sys/stat.h>
#include <unistd.h>

#include <cstdio>
#include <cstdlib>
#include <string>
#include <vector>

#include "hal/simulated/simulated_camera.hpp"
#include "tests/openni2/driver/control.hpp"

namespace stillmesh::test {
namespace {

void add_mm(const DepthView& depth, std::vector<std::uint8_t>& out) {
    for (std::uint32_t y = 0; y < depth.height; ++y) {
        for (std::uint32_t x = 0; x < depth.width; ++x) {
            const auto mm = static_cast<std::uint16_t>((depth.at(x, y) + 2) / 5);
            out.push_back(static_cast<std::uint8_t>(mm & 0xffU));
            out.push_back(static_cast<std::uint8_t>(mm >> 8U));
        }
    }
}

int render(char** arguments) {
    const std::string out = arguments[7];
    struct stat about {};
    if (::stat(out.c_str(), &about) == 0) return 0;
    SimulationOptions options;
    options.scene = arguments[1];
    options.seed = std::strtoull(arguments[2], nullptr, 10);
    options.width = static_cast<std::uint32_t>(std::atoi(arguments[3]));
    options.height = static_cast<std::uint32_t>(std::atoi(arguments[4]));
    options.frames = static_cast<std::uint32_t>(std::atoi(arguments[5]));
    const bool has_raw = std::atoi(arguments[6]) != 0;
    SimulatedCamera camera(options);
    options.depth_baseline_m = 0.025;
    SimulatedCamera raw(options);
    if (camera.open() != Status::kOk || raw.open() != Status::kOk) {
        std::fprintf(stderr, "render_frames: %s\n", camera.message().c_str());
        return 2;
    }
    // Beside it, then renamed: nobody sees half of it.
    const std::string beside = out + "." + std::to_string(::getpid());
    std::FILE* const file = std::fopen(beside.c_str(), "wb");
    if (file == nullptr) return 1;
    FramesHead head{};
    head.magic = kFramesMagic;
    head.width = options.width;
    head.height = options.height;
    head.count = options.frames;
    head.fx = camera.info().model.fx;
    head.has_raw_depth = has_raw ? 1 : 0;
    head.seed = static_cast<std::uint32_t>(options.seed);
    bool is_written = std::fwrite(&head, sizeof(head), 1, file) == 1;
    std::vector<std::uint8_t> bytes;
    for (std::uint32_t i = 0; i < options.frames && is_written; ++i) {
        Frame frame;
        if (camera.poll(frame) != Status::kOk) return 1;
        FramesHead::Pose pose{};
        for (std::size_t k = 0; k < 3; ++k) pose.t[k] = camera.true_pose().t[k];
        for (std::size_t k = 0; k < 4; ++k) pose.q[k] = camera.true_pose().q[k];
        bytes.clear();
        for (std::uint32_t y = 0; y < frame.colour.height; ++y) {
            bytes.insert(bytes.end(), frame.colour.row(y), frame.colour.row(y) + frame.colour.width);
        }
        add_mm(frame.depth, bytes);
        if (has_raw) {
            Frame unregistered;
            if (raw.poll(unregistered) != Status::kOk) return 1;
            add_mm(unregistered.depth, bytes);
        }
        is_written = std::fwrite(&pose, sizeof(pose), 1, file) == 1 &&
                     std::fwrite(bytes.data(), 1, bytes.size(), file) == bytes.size();
    }
    is_written = std::fclose(file) == 0 && is_written;
    if (is_written && std::rename(beside.c_str(), out.c_str()) == 0) return 0;
    static_cast<void>(std::remove(beside.c_str()));
    return 1;
}

}  // namespace
}  // namespace stillmesh::test

int main(int argc, char** argv) {
    if (argc != 8) return 2;
    return stillmesh::test::render(argv);
}
