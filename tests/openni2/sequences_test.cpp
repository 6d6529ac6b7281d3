// Random lives of a camera under the real OpenNI2: unplugged, plugged in, stalled, spoilt, in any order, with a
// watchdog, and the engine tracking what comes. Silences are a tenth of the real ones, so that many fit.
// STILLMESH_SEQUENCES says how many; a few by default. A life is mostly waiting: STILLMESH_SEQUENCES_AT_ONCE processes
// share them, each with a camera of its own.
#include <gtest/gtest.h>

#include <atomic>
#include <memory>
#include <random>
#include <sstream>

#include "hal/live/reconnecting_camera.hpp"
#include "hal/openni2/openni2_camera.hpp"
#include "platform/cli/engine_session.hpp"
#include "tests/openni2/rig.hpp"

namespace stillmesh::sequences_test {
namespace {

using test::CameraRig;

// Ends the process when nobody has reported for too long: a hang is a failure with a name.
class Watchdog {
public:
    explicit Watchdog(std::int64_t limit_ms) : limit_ns_(limit_ms * 1'000'000), thread_([this] { watch(); }) {}
    ~Watchdog() {
        is_ending_ = true;
        thread_.join();
    }
    Watchdog(const Watchdog&) = delete;
    Watchdog& operator=(const Watchdog&) = delete;
    void report(int sequence) {
        sequence_ = sequence;
        last_ns_ = test::now_ns();
    }

private:
    void watch() {
        while (!is_ending_) {
            std::this_thread::sleep_for(std::chrono::milliseconds(50));
            if (test::now_ns() - last_ns_ > limit_ns_) {
                std::fprintf(stderr, "watchdog: sequence %d hangs\n", sequence_.load());
                std::abort();
            }
        }
    }
    std::int64_t limit_ns_;
    std::atomic<std::int64_t> last_ns_{test::now_ns()};
    std::atomic<int> sequence_{0};
    std::atomic<bool> is_ending_{false};
    std::thread thread_;
};

[[nodiscard]] int number_of(const char* name, int otherwise) {
    const char* const text = std::getenv(name);
    return text != nullptr ? std::atoi(text) : otherwise;
}

// The lives from `first` on, shared between processes of this program, whose reports are printed.
void live_at_once(int sequences, int processes) {
    const test::TemporaryFolder folder;
    std::vector<std::unique_ptr<test::Program>> programs;
    ::setenv("STILLMESH_SEQUENCES_AT_ONCE", "1", 1);
    for (int i = 0; i < processes; ++i) {
        const int first = sequences * i / processes;
        ::setenv("STILLMESH_SEQUENCES_FIRST", std::to_string(first).c_str(), 1);
        ::setenv("STILLMESH_SEQUENCES", std::to_string(sequences * (i + 1) / processes - first).c_str(), 1);
        programs.push_back(std::make_unique<test::Program>("/proc/self/exe", STILLMESH_PRIVATE_OPENNI2,
                                                           "--gtest_filter=CameraSequences.AnyLifeIsSurvived", folder));
    }
    for (const std::unique_ptr<test::Program>& program : programs) {
        const int code = program->wait(std::int64_t{1000} * (60 + 10 * sequences));
        const std::string out = program->out();
        EXPECT_EQ(code, 0) << out << program->err();
        std::istringstream lines(out);
        for (std::string line; std::getline(lines, line);) {
            if (line.find(" sequences, ") != std::string::npos) std::printf("%s\n", line.c_str());
        }
    }
}

// Promise: whatever happens to the camera, no call hangs or crashes, frames only go on in time, and they are tracked
// again (a measured pose) within two seconds of the camera being well.
TEST(CameraSequences, AnyLifeIsSurvived) {
    const int sequences = number_of("STILLMESH_SEQUENCES", 20);
    const int processes = number_of("STILLMESH_SEQUENCES_AT_ONCE", 1);
    const int first = number_of("STILLMESH_SEQUENCES_FIRST", 0);
    if (processes > 1) return live_at_once(sequences, processes);
    CameraRig rig(STILLMESH_SMALL_FRAMES);
    test::CameraControl& control = rig.camera();
    control.depth_lag_us = 500;
    control.is_plugged = 1;
    OpenNi2Options camera_options;
    camera_options.open_max_ms = 3000;
    OpenNi2Camera source(camera_options);
    ReconnectOptions options;
    options.now_ns = [] { return test::now_ns(); };
    options.sleep_until_ns = [](std::int64_t until_ns) {
        std::this_thread::sleep_for(std::chrono::nanoseconds(until_ns - test::now_ns()));
    };
    options.source_message = [&source] { return source.message(); };
    options.times = &source;
    options.stall_ns = 100'000'000;
    options.stall_max_ns = 800'000'000;
    options.retry_first_ns = 10'000'000;
    options.retry_max_ns = 50'000'000;
    ReconnectingCamera camera(source, options);
    Watchdog watchdog(20'000);
    ASSERT_TRUE(test::within(3000, [&] { return camera.open() == Status::kOk; })) << source.message();

    std::unique_ptr<TrackingSession> session;
    std::string message;
    ASSERT_EQ(create_engine_session({}, camera.info(), session, message), Status::kOk) << message;

    std::int64_t last_ns = 0;
    std::int64_t slowest_frame_ns = 0, slowest_pose_ns = 0;  // after the camera is well
    std::int64_t slowest_poll_ns = 0;
    std::uint64_t frames = 0, poses = 0;
    // When the first frame came, and the first measured pose; 0: none did.
    struct Firsts {
        std::int64_t frame_ns = 0, pose_ns = 0;
    };
    const auto poll_until = [&](std::int64_t end_ns, bool does_end_with_pose) {
        Firsts firsts;
        while (test::now_ns() < end_ns && !(firsts.pose_ns != 0 && does_end_with_pose)) {
            Frame frame;
            const std::int64_t begin_ns = test::now_ns();
            const Status status = camera.poll(frame);
            if (status == Status::kOk) {
                EXPECT_GT(frame.time_ns, last_ns);
                EXPECT_EQ(frame.colour.width, 320U);
                EXPECT_EQ(frame.depth.height, 240U);
                last_ns = frame.time_ns;
                if (frames++, firsts.frame_ns == 0) firsts.frame_ns = test::now_ns();
                SessionFrame out;
                EXPECT_EQ(session->submit(frame, out, message), Status::kOk) << message;
                session->work(std::nullopt, out);
                if (out.state >= PoseState::kUnsure) {
                    if (poses++, firsts.pose_ns == 0) firsts.pose_ns = test::now_ns();
                }
            } else {
                EXPECT_EQ(status, Status::kTimedOut);
                static_cast<void>(camera.wait(10));
            }
            slowest_poll_ns = std::max(slowest_poll_ns, test::now_ns() - begin_ns);
            while (!camera.take_news().empty()) {
            }
        }
        return firsts;
    };
    for (int i = first; i < first + sequences; ++i) {
        watchdog.report(i);
        std::mt19937 random(static_cast<std::uint32_t>(i));
        const std::uint32_t steps = 1 + random() % 4;
        for (std::uint32_t step = 0; step < steps; ++step) {
            switch (random() % 9) {
                case 0:
                case 1:
                case 2: control.is_plugged = control.is_plugged == 0 ? 1 : 0; break;
                case 3:
                case 4: control.is_stalled = control.is_stalled == 0 ? 1 : 0; break;
                case 5: control.drop_colour_every = static_cast<std::uint32_t>(random() % 3); break;
                case 6: control.emits_wrong_size = static_cast<std::uint32_t>(random() % 2); break;
                case 7: control.is_frozen = static_cast<std::uint32_t>(random() % 2); break;
                default:
                    control.stamp_offset_us = static_cast<std::int64_t>(random() % 5'000'000);
                    control.does_open_fail = static_cast<std::uint32_t>(random() % 2);
                    control.hang_ms = static_cast<std::uint32_t>(random() % 30);
                    break;
            }
            static_cast<void>(
                poll_until(test::now_ns() + static_cast<std::int64_t>(random() % 300) * 1'000'000, false));
        }
        control.is_stalled = control.drop_colour_every = control.emits_wrong_size = control.is_frozen =
            control.does_open_fail = control.hang_ms = 0;
        control.is_plugged = 1;
        const std::int64_t well_ns = test::now_ns();
        const Firsts firsts = poll_until(well_ns + 5'000'000'000, true);
        ASSERT_NE(firsts.frame_ns, 0) << "sequence " << i;
        ASSERT_NE(firsts.pose_ns, 0) << "sequence " << i;
        slowest_frame_ns = std::max(slowest_frame_ns, firsts.frame_ns - well_ns);
        slowest_pose_ns = std::max(slowest_pose_ns, firsts.pose_ns - well_ns);
        EXPECT_LT(firsts.pose_ns - well_ns, 2'000'000'000) << "sequence " << i;
    }
    camera.close();
    EXPECT_TRUE(test::within(3000, [&] { return control.opens == control.closes; }));
    std::printf(
        "%d sequences, %u openings, %llu frames, %llu measured poses; once it is well a frame within %.2f s, a pose "
        "within %.2f s; slowest poll %.2f s\n",
        sequences, control.opens.load(), static_cast<unsigned long long>(frames),
        static_cast<unsigned long long>(poses), static_cast<double>(slowest_frame_ns) * 1e-9,
        static_cast<double>(slowest_pose_ns) * 1e-9, static_cast<double>(slowest_poll_ns) * 1e-9);
}

}  // namespace
}  // namespace stillmesh::sequences_test
