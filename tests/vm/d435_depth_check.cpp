// Whether the depth of a recording made with the emulated D435 lies where it belongs: each of its frames is compared,
// pixel by pixel, with the depth of the colour camera's view as it was rendered. A calibration that is read wrongly, or
// used the wrong way round, moves borders: with the colour camera in its place 1.0 % of the pixels are off by more than
// 3 %, without the 15 mm between the cameras 6.0 %, with these to the other side 14.0 %. At 848x480 the depth camera
// sees 75 % of the colour camera's 640x480, at its field of view. Exit code 1: more than 3 % are off, or fewer than 65
// % have depth.
//   d435_depth_check RECORDING PICTURES CLOCK     CLOCK: as `d435_camera tell clock` says
#include <cmath>
#include <cstdint>
#include <cstdio>
#include <cstdlib>
#include <fstream>
#include <string>
#include <vector>

#include "hal/replay/replay_camera.hpp"

namespace {

constexpr std::size_t kPixels = std::size_t{640} * 480;

struct Counts {
    std::uint64_t rendered = 0, given = 0, wrong = 0;
};

void compare(const std::uint16_t* rendered, const stillmesh::Frame& frame, Counts& counts) {
    for (std::size_t i = 0; i < kPixels; ++i) {
        if (rendered[i] == 0) continue;
        ++counts.rendered;
        const double given_mm =
            frame.depth.row(static_cast<std::uint32_t>(i / 640))[i % 640] * 1000.0 / frame.depth_units_per_m;
        if (given_mm == 0) continue;
        ++counts.given;
        if (std::abs(given_mm - rendered[i]) > 0.03 * rendered[i]) ++counts.wrong;
    }
}

}  // namespace

int main(int argc, char** argv) {
    if (argc != 4) return 2;
    std::ifstream file(std::string(argv[2]) + "/registered_640x480", std::ios::binary | std::ios::ate);
    const auto pictures = static_cast<std::int64_t>(file.tellg()) / static_cast<std::int64_t>(kPixels * 2);
    stillmesh::ReplayOptions options;
    options.folder = argv[1];
    stillmesh::ReplayCamera recording(options);
    if (pictures < 2 || recording.open() != stillmesh::Status::kOk) {
        std::fprintf(stderr, "%s\n", pictures < 2 ? "no rendered depth" : recording.message().c_str());
        return 2;
    }
    const double clock_s = std::strtod(argv[3], nullptr);
    std::vector<std::uint16_t> rendered(kPixels);
    Counts counts;
    stillmesh::Frame frame;
    std::uint32_t frames = 0;
    while (recording.poll(frame) == stillmesh::Status::kOk) {
        if (frame.depth.width != 640 || frame.depth.height != 480) return 2;
        // Thirty a second, there and back again.
        const double time_s = static_cast<double>(frame.time_ns) * 1e-9 - clock_s;
        std::int64_t number = static_cast<std::int64_t>(time_s * 30 + 0.2) % (2 * (pictures - 1));
        if (number >= pictures) number = 2 * (pictures - 1) - number;
        file.seekg(number * static_cast<std::int64_t>(kPixels * 2));
        if (!file.read(reinterpret_cast<char*>(rendered.data()), kPixels * 2)) return 2;
        compare(rendered.data(), frame, counts);
        ++frames;
    }
    const auto percent = [](std::uint64_t part, std::uint64_t whole) {
        return whole == 0 ? 0 : 100 * static_cast<double>(part) / static_cast<double>(whole);
    };
    const double given = percent(counts.given, counts.rendered), wrong = percent(counts.wrong, counts.given);
    std::printf("%u frames: %.2f %% of the pixels have depth, %.2f %% of these are wrong\n", frames, given, wrong);
    return given >= 65 && wrong <= 3 ? 0 : 1;
}
