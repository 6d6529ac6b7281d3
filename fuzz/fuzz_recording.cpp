// A whole recording folder through ReplayCamera: rgb.txt, depth.txt and camera.toml, with a byte 0 between them, beside
// images that are good, of another kind or size, broken, or missing. Opening gives a sentence or a camera; polling
// ends, and every frame is one.
#include <algorithm>
#include <string>
#include <string_view>

#include "fuzz/fuzz.hpp"
#include "hal/replay/replay_camera.hpp"
#include "tests/replay/recording_folder.hpp"

namespace {

using namespace stillmesh;

// Images that lists can name; the lists are written anew for every input.
const std::string& folder_with_images() {
    static const test::TemporaryFolder folder;
    static const bool is_written = [] {
        const std::string at = folder.path() + "/";
        test::write_colour(at + "g.png", 64, 48, false, 0);
        test::write_colour(at + "c.png", 64, 48, true, 1);
        test::write_depth(at + "d.png", 64, 48, 2);
        test::write_depth(at + "s.png", 32, 48, 3);
        std::string broken = test::read_text(at + "d.png");
        broken.resize(broken.size() / 2);
        test::write_text(at + "b.png", broken);
        test::write_text(at + "e.png", "");
        return true;
    }();
    static_cast<void>(is_written);
    return folder.path();
}

}  // namespace

extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size_bytes) {
    const std::string& folder = folder_with_images();
    std::string_view text(reinterpret_cast<const char*>(data), size_bytes);
    for (const char* const name : {"/rgb.txt", "/depth.txt", "/camera.toml"}) {
        const std::size_t cut = std::min(text.find('\0'), text.size());
        test::write_text(folder + name, std::string(text.substr(0, cut)));
        text.remove_prefix(std::min(cut + 1, text.size()));
    }
    ReplayOptions options;
    options.folder = folder;
    options.width_max = 64;
    options.height_max = 48;
    if (!text.empty()) options.calibration = "tum-fr1";
    ReplayCamera camera(options);
    Frame frame;
    const Status opened = camera.open();
    if (opened != Status::kOk) {
        fuzz::expect(!camera.message().empty(), "a folder that cannot be opened gets a sentence");
        fuzz::expect(camera.poll(frame) == Status::kUnavailable, "a closed camera has no frames");
        return 0;
    }
    const CameraModel& model = camera.info().model;
    fuzz::expect(model.width > 0 && model.width <= 64 && model.height > 0 && model.height <= 48,
                 "an open camera knows its size, within the limits");
    std::int64_t last_ns = -1;
    std::size_t polls = 0;
    for (Status status = Status::kOk; status != Status::kEnd; ++polls) {
        fuzz::expect(polls <= camera.counts().frames, "a recording ends");
        status = camera.poll(frame);
        if (status != Status::kOk) {
            fuzz::expect(status == Status::kEnd || !camera.message().empty(),
                         "a frame that is skipped gets a sentence");
            continue;
        }
        fuzz::expect(frame.time_ns > last_ns, "times rise");
        last_ns = frame.time_ns;
        fuzz::expect(frame.colour.width == model.width && frame.colour.height == model.height &&
                         frame.depth.width == model.width && frame.depth.height == model.height,
                     "all frames have the camera's size");
        fuzz::expect(frame.depth_units_per_m > 0, "the depth factor is positive");
        // Reads every pixel that the views promise.
        std::uint32_t sum = 0;
        for (std::uint32_t y = 0; y < model.height; ++y) {
            for (std::uint32_t x = 0; x < model.width * channels_of(frame.format); ++x) sum += frame.colour.at(x, y);
            for (std::uint32_t x = 0; x < model.width; ++x) sum += frame.depth.at(x, y);
        }
        volatile std::uint32_t sink = sum;
        static_cast<void>(sink);
    }
    fuzz::expect(camera.poll(frame) == Status::kEnd, "the end stays the end");
    camera.close();
    fuzz::expect(camera.poll(frame) == Status::kUnavailable, "a closed camera has no frames");
    return 0;
}
