// FreenectCamera over fakenect, libfreenect's own player of recordings, on a recording that the test makes.
#include <gtest/gtest.h>
#include <unistd.h>

#include <chrono>
#include <cmath>
#include <cstdint>
#include <cstdio>
#include <cstdlib>
#include <filesystem>
#include <fstream>
#include <string>
#include <vector>

#include "hal/freenect/freenect_camera.hpp"

namespace stillmesh {
namespace {

constexpr std::uint32_t kFrames = 12;
constexpr std::uint32_t kWidth = FreenectCamera::kWidth;
constexpr std::uint32_t kHeight = FreenectCamera::kHeight;

// The raw value whose depth is nearest.
[[nodiscard]] std::uint16_t raw_of(std::uint16_t depth_mm) {
    std::uint16_t best = 0;
    for (std::uint16_t raw = 0; raw < 2047; ++raw) {
        if (std::abs(kinect_millimetres(raw) - depth_mm) < std::abs(kinect_millimetres(best) - depth_mm)) best = raw;
    }
    return best;
}

// A folder as libfreenect's recorder writes it: pairs 33 ms apart, depth 8 ms after colour. A wall at 3 m; frame i
// shows a board of (i + 1) columns of 40 px at 1.5 m from the left, and i in every colour value. Two depth images are
// missing.
class Recording {
public:
    Recording() {
        char name[] = "/tmp/stillmesh_fakenect_XXXXXX";
        folder_ = ::mkdtemp(name);
        std::ofstream index(folder_ + "/INDEX.txt");
        const std::uint16_t wall = raw_of(3000);
        const std::uint16_t board = raw_of(1500);
        for (std::uint32_t i = 0; i < kFrames; ++i) {
            std::string colour(std::size_t{3} * kWidth * kHeight, static_cast<char>(i));
            write(index, 'r', i, 0, "ppm", "P6 640 480 255\n", colour);
            if (i == 3 || i == 7) continue;
            std::vector<std::uint16_t> depth(std::size_t{kWidth} * kHeight, wall);
            for (std::size_t k = 0; k < depth.size(); ++k) {
                if (k % kWidth < 40 * (i + 1)) depth[k] = board;
            }
            write(index, 'd', i, 8, "pgm", "P5 640 480 65535\n",
                  std::string(reinterpret_cast<const char*>(depth.data()), depth.size() * 2));
        }
    }
    ~Recording() {
        std::error_code error;
        std::filesystem::remove_all(folder_, error);
    }
    Recording(const Recording&) = delete;
    Recording& operator=(const Recording&) = delete;

    [[nodiscard]] const std::string& folder() const { return folder_; }

private:
    void write(std::ofstream& index, char kind, std::uint32_t i, std::uint32_t later_ms, const char* ending,
               const char* head, const std::string& pixels) const {
        char name[80];
        std::snprintf(name, sizeof(name), "%c-%.6f-%u.%s", kind, 1000.0 + i * 0.0333 + later_ms * 1e-3,
                      4'294'000'000U + i * 2'000'000U + later_ms * 60'000U, ending);  // wraps on the way
        std::ofstream(folder_ + "/" + name, std::ios::binary) << head << pixels;
        index << name << '\n';
    }
    std::string folder_;
};

// Promise: through libfreenect's own player every pair arrives, paired by time and not by number, with depth in
// millimetres in the colour camera's view, and the end of the recording is the end of the device.
TEST(Fakenect, PlaysARecording) {
    const Recording recording;
    ASSERT_EQ(::setenv("FAKENECT_PATH", recording.folder().c_str(), 1), 0);
    FreenectCamera camera;
    ASSERT_EQ(camera.open(), Status::kOk) << camera.message();
    EXPECT_FALSE(camera.is_registered_by_driver()) << "Debian's player has raw depth only";
    // 25 mm between the cameras move the board's edge in the colour image by fx * 0.025 / 1.5.
    const double fx = camera.info().model.fx;
    std::uint32_t frames = 0;
    std::int64_t last_ns = 0;
    std::uint32_t last = 0;
    const auto begin = std::chrono::steady_clock::now();
    for (;;) {
        const Status waited = camera.wait(2000);
        if (waited == Status::kUnavailable) break;
        ASSERT_EQ(waited, Status::kOk);
        Frame frame;
        ASSERT_EQ(camera.poll(frame), Status::kOk);
        const std::uint32_t i = frame.colour.row(100)[300];
        ASSERT_LT(i, kFrames);
        EXPECT_TRUE(i != 3 && i != 7) << "a colour image without depth";
        if (frames > 0) {
            EXPECT_GT(i, last);
            EXPECT_NEAR(static_cast<double>(frame.time_ns - last_ns), (i - last) * 33.3333e6, 3e3);
        }
        EXPECT_EQ(frame.depth_time_ns - frame.time_ns, 8'000'000);
        last = i;
        last_ns = frame.time_ns;
        ++frames;
        const std::uint16_t* const row = frame.depth.row(240);
        EXPECT_NEAR(row[600], 3000, 30);
        EXPECT_EQ(row[600], kinect_millimetres(raw_of(3000)));
        const double scale = fx / 585.6;
        const double edge = (40.0 * (i + 1) - 0.5 - 319.5) * scale + camera.info().model.cx - fx * 0.025 / 1.5;
        const auto inside = static_cast<int>(std::floor(edge)) - 2;
        const auto outside = static_cast<int>(std::ceil(edge)) + 2;
        if (inside >= 4) {
            EXPECT_NEAR(row[inside], 1500, 8) << i << " at " << edge;
        }
        // Behind the board's edge the depth camera sees the wall where the colour camera does, or nothing.
        EXPECT_TRUE(row[outside] == 0 || row[outside] > 2900) << i << " at " << edge << ": " << row[outside];
    }
    EXPECT_LT(std::chrono::duration<double>(std::chrono::steady_clock::now() - begin).count(), 10.0);
    const FreenectCounts counts = camera.counts();
    EXPECT_EQ(counts.images_colour, kFrames);
    EXPECT_EQ(counts.images_depth, kFrames - 2);
    EXPECT_EQ(counts.pairing.pairs, kFrames - 2);
    EXPECT_EQ(counts.pairing.colour_alone, 2U);
    EXPECT_EQ(counts.pairing.depth_alone, 0U);
    EXPECT_EQ(frames + counts.dropped, kFrames - 2);
    EXPECT_GE(frames, 1U);
    Frame frame;
    EXPECT_EQ(camera.poll(frame), Status::kUnavailable);
}

}  // namespace
}  // namespace stillmesh

// The player has the library's name: start again with its folder searched first.
int main(int argc, char** argv) {
    const char* const path = std::getenv("LD_LIBRARY_PATH");
    if (path == nullptr || std::string(path).find(STILLMESH_FAKENECT_FOLDER) == std::string::npos) {
        const std::string folders =
            std::string(STILLMESH_FAKENECT_FOLDER) + (path != nullptr ? ":" : "") + (path != nullptr ? path : "");
        static_cast<void>(::setenv("LD_LIBRARY_PATH", folders.c_str(), 1));
        ::execv("/proc/self/exe", argv);
        std::perror("execv");
        return 1;
    }
    ::testing::InitGoogleTest(&argc, argv);
    return RUN_ALL_TESTS();
}
