// FreenectCamera, and the program with it, over fakenect, libfreenect's own player of recordings, on recordings that
// the test makes.
#include <gtest/gtest.h>
#include <unistd.h>

#include <algorithm>
#include <chrono>
#include <cmath>
#include <cstdint>
#include <cstdio>
#include <cstdlib>
#include <fstream>
#include <nlohmann/json.hpp>
#include <string>
#include <vector>

#include "hal/freenect/freenect_camera.hpp"
#include "hal/simulated/simulated_camera.hpp"
#include "platform/evaluation/evaluation.hpp"
#include "tests/support/program.hpp"

namespace stillmesh::fakenect_test {
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

// A folder as libfreenect's recorder writes it: pairs 33 ms apart, depth 8 ms after colour.
class KinectFolder {
public:
    KinectFolder() : index_(folder_.path("INDEX.txt")) {}
    KinectFolder(const KinectFolder&) = delete;
    KinectFolder& operator=(const KinectFolder&) = delete;

    [[nodiscard]] const std::string& folder() const { return folder_.path(); }

protected:
    void add_colour(std::uint32_t i, const std::vector<std::uint8_t>& rgb) {
        write('r', i, 0, "ppm", "P6 640 480 255\n", reinterpret_cast<const char*>(rgb.data()), rgb.size());
    }
    void add_depth(std::uint32_t i, const std::vector<std::uint16_t>& raw) {
        write('d', i, 8, "pgm", "P5 640 480 65535\n", reinterpret_cast<const char*>(raw.data()), raw.size() * 2);
    }

private:
    void write(char kind, std::uint32_t i, std::uint32_t later_ms, const char* ending, const char* head,
               const char* pixels, std::size_t bytes) {
        char name[80];
        std::snprintf(name, sizeof(name), "%c-%.6f-%u.%s", kind, 1000.0 + i * 0.0333 + later_ms * 1e-3,
                      4'294'000'000U + i * 2'000'000U + later_ms * 60'000U, ending);  // wraps on the way
        std::ofstream file(folder_.path(name), std::ios::binary);
        file << head;
        file.write(pixels, static_cast<std::streamsize>(bytes));
        index_ << name << '\n' << std::flush;
    }
    const test::TemporaryFolder folder_;
    std::ofstream index_;
};

// A wall at 3 m; frame i shows a board of (i + 1) columns of 40 px at 1.5 m from the left, and i in every colour value.
// Two depth images are missing.
class Recording : public KinectFolder {
public:
    Recording() {
        const std::uint16_t wall = raw_of(3000);
        const std::uint16_t board = raw_of(1500);
        for (std::uint32_t i = 0; i < kFrames; ++i) {
            add_colour(i, std::vector<std::uint8_t>(std::size_t{3} * kWidth * kHeight, static_cast<std::uint8_t>(i)));
            if (i == 3 || i == 7) continue;
            std::vector<std::uint16_t> depth(std::size_t{kWidth} * kHeight, wall);
            for (std::size_t k = 0; k < depth.size(); ++k) {
                if (k % kWidth < 40 * (i + 1)) depth[k] = board;
            }
            add_depth(i, depth);
        }
    }
};

// A second in a simulated room, as a Kinect would record it: depth in raw values, as its own camera of
// another focal length sees it, 25 mm beside the colour camera.
class RoomRecording : public KinectFolder {
public:
    static constexpr std::uint32_t kFrames = 30;

    RoomRecording() {
        std::vector<std::uint16_t> raw_of_mm(10'001, 2047);  // no depth
        for (std::uint16_t raw = 0; raw < 2047; ++raw) {
            const std::uint16_t mm = kinect_millimetres(raw);
            if (mm > 0 && mm < raw_of_mm.size()) raw_of_mm[mm] = raw;
        }
        std::size_t last = 0;  // what lies between two raw values belongs to the nearer
        for (std::size_t mm = 1; mm < raw_of_mm.size(); ++mm) {
            if (raw_of_mm[mm] == 2047) continue;
            for (std::size_t k = last + 1; last > 0 && k < mm; ++k) {
                raw_of_mm[k] = raw_of_mm[2 * k < last + mm ? last : mm];
            }
            last = mm;
        }
        SimulationOptions options{.scene = "sitting_xyz", .seed = 1, .frames = kFrames};
        SimulatedCamera colour(options);
        options.depth_baseline_m = 0.025;
        SimulatedCamera beside(options);
        if (colour.open() != Status::kOk || beside.open() != Status::kOk) std::abort();
        const CameraModel& model = colour.info().model;
        std::vector<std::uint8_t> rgb(std::size_t{3} * kWidth * kHeight);
        std::vector<std::uint16_t> raw(std::size_t{kWidth} * kHeight);
        const auto place = [](std::uint32_t at, double size, double f, double c) {
            return static_cast<std::uint32_t>(std::lround((at - (size - 1) / 2) * f / FreenectOptions().depth_fx + c));
        };
        for (std::uint32_t i = 0; i < kFrames; ++i) {
            Frame frame, depth;
            if (colour.poll(frame) != Status::kOk || beside.poll(depth) != Status::kOk) std::abort();
            truth_.push_back({frame.time_ns, colour.true_pose().t, colour.true_pose().q});
            for (std::uint32_t y = 0; y < kHeight; ++y) {
                for (std::uint32_t x = 0; x < kWidth; ++x) {
                    const std::size_t at = std::size_t{y} * kWidth + x;
                    rgb[3 * at] = rgb[3 * at + 1] = rgb[3 * at + 2] = frame.colour.row(y)[x];
                    const std::size_t mm = std::size_t{depth.depth.at(place(x, kWidth, model.fx, model.cx),
                                                                      place(y, kHeight, model.fy, model.cy))} /
                                           5;
                    raw[at] = raw_of_mm[std::min(mm, raw_of_mm.size() - 1)];
                }
            }
            add_colour(i, rgb);
            add_depth(i, raw);
        }
    }
    [[nodiscard]] const Trajectory& truth() const { return truth_; }

private:
    Trajectory truth_;
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
    const LiveCounts counts = camera.counts();
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

// The program on the player: `stillmesh ARGUMENTS`.
[[nodiscard]] test::Program start(const std::string& arguments, const test::TemporaryFolder& folder) {
    return {STILLMESH_PROGRAM, STILLMESH_FAKENECT_FOLDER, arguments, folder};
}
[[nodiscard]] nlohmann::json json_of(const test::Program& program) {
    // The player, too, writes to standard output.
    const std::string text = program.out();
    const nlohmann::json json =
        nlohmann::json::parse(text.substr(std::min(text.find("{\n"), text.size())), nullptr, false);
    EXPECT_FALSE(json.is_discarded()) << text << program.err();
    return json;
}

// Promise: the whole program tracks a Kinect: every frame a right pose, and the summary says what the camera is. When
// libfreenect gives it up it says so, and Ctrl-C ends it with all written. What capture writes is tracked again.
TEST(Fakenect, TheProgramTracksAKinect) {
    const RoomRecording recording;
    ASSERT_EQ(::setenv("FAKENECT_PATH", recording.folder().c_str(), 1), 0);
    const test::TemporaryFolder folder;
    const std::string path = folder.path("path.txt");
    {
        // The player plays once, at its pace; then the Kinect stays away.
        test::Program run = start("run --camera freenect --json --trajectory " + path, folder);
        ASSERT_TRUE(test::within(60'000, [&] {
            return test::text_of(path).find("# the camera is gone (libfreenect has given it up)") != std::string::npos;
        })) << run.err();
        run.signal(SIGINT);
        ASSERT_EQ(run.wait(20'000), 130) << run.err();
        const nlohmann::json json = json_of(run);
        EXPECT_GE(json["frames"], 5) << "30, on a machine that is not busy";
        EXPECT_GT(json["coverage"], 0.95);
        EXPECT_EQ(json["is_realtime"], true);
        EXPECT_EQ(json["camera"]["device"], "Kinect, 640x480@30, depth registered here");
        EXPECT_NEAR(json["camera"]["lag_mean_ms"].get<double>(), 8.0, 0.01);
        EXPECT_EQ(json["life"]["unplugs"], 1);
        Trajectory estimate;
        std::string message;
        ASSERT_EQ(read_trajectory(path, estimate, message), Status::kOk) << message;
        ASSERT_FALSE(estimate.empty());
        // The program's times are the time of day of a player that may begin behind its first frame.
        double best_m = 1;
        for (std::uint32_t first = 0; first < 10; ++first) {
            Trajectory truth = recording.truth();
            for (std::uint32_t i = 0; i < RoomRecording::kFrames; ++i) {
                truth[i].time_ns = estimate[0].time_ns + (std::int64_t{i} - first) * 33'333'333;
            }
            if (const auto evaluation = evaluate(truth, estimate)) best_m = std::min(best_m, evaluation->ate_rmse_m);
        }
        std::printf("ATE %.4f m, camera layer %.2f ms per frame\n", best_m,
                    json["camera"]["layer_cpu_ms"].get<double>());
        EXPECT_LT(best_m, 0.02);
    }
    {
        test::Program capture =
            start("capture --camera freenect --frames 3 --json --out " + folder.path("room"), folder);
        ASSERT_EQ(capture.wait(60'000), 0) << capture.err();
        EXPECT_EQ(json_of(capture)["frames"], 3);
        test::Program replay = start("run --replay " + folder.path("room") + " --json", folder);
        ASSERT_EQ(replay.wait(60'000), 0) << replay.err();
        EXPECT_EQ(json_of(replay)["frames"], 3);
        EXPECT_EQ(json_of(replay)["coverage"], 1.0);
    }
}

// Promise: what a Kinect cannot do is refused with what to do instead; nothing is opened for it.
TEST(Fakenect, TheProgramRefusesWhatAKinectCannot) {
    const test::TemporaryFolder folder;
    const char* const cases[][2] = {
        {"run --camera freenect:one", "from freenect:0 on"},
        {"run --camera freenect:", "give auto, openni2"},
        {"run --camera freenect --exposure fixed", "--exposure: cannot be chosen for a Kinect; leave it out."},
        {"run --camera freenect --registration none", "--registration: cannot be chosen"},
        {"run --camera freenect --calibration none.toml", "none.toml"},
        {"capture --camera freenect --out x.oni", "give a folder for a Kinect"},
    };
    for (const auto& [arguments, sentence] : cases) {
        test::Program program = start(arguments, folder);
        EXPECT_EQ(program.wait(20'000), 2) << arguments;
        EXPECT_NE(program.err().find(sentence), std::string::npos) << arguments << ": " << program.err();
    }
}

}  // namespace
}  // namespace stillmesh::fakenect_test

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
