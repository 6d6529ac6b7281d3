// The whole program on a live camera: the real OpenNI2, our driver, a process of its own.
#include <gtest/gtest.h>

#include <algorithm>
#include <atomic>
#include <cmath>
#include <filesystem>
#include <memory>
#include <nlohmann/json.hpp>

#include "platform/evaluation/evaluation.hpp"
#include "tests/openni2/rig.hpp"

namespace stillmesh::program_test {
namespace {

using test::CameraRig;
using test::Program;
using test::within;

class LiveProgram : public testing::Test {
protected:
    LiveProgram() : rig(STILLMESH_SMALL_FRAMES) {}

    Program start(const std::string& arguments) {
        return Program(STILLMESH_PROGRAM, STILLMESH_PRIVATE_OPENNI2, arguments, scratch);
    }
    static nlohmann::json json_of(const Program& program) {
        const std::string text = program.out();
        const nlohmann::json json = nlohmann::json::parse(text, nullptr, false);
        EXPECT_FALSE(json.is_discarded()) << text << program.err();
        return json;
    }
    // Lines of a trajectory that are poses.
    std::size_t poses(const std::string& file) const {
        const std::string text = test::text_of(scratch.path(file));
        std::istringstream lines(text);
        std::size_t count = 0;
        for (std::string line; std::getline(lines, line);) count += !line.empty() && line[0] != '#';
        return count;
    }
    // Where the camera was, by the times that the program gives its frames.
    Trajectory truth() {
        const std::int64_t to_unix_ns = test::now_ns(CLOCK_REALTIME) - test::now_ns();
        Trajectory truth;
        for (std::uint32_t i = 0; i < rig.camera().log_count; ++i) {
            const test::EmittedFrame& frame = rig.camera().log[i];
            const test::FramesHead::Pose& pose = rig.pose(frame.index);
            TrajectoryPose out;
            out.time_ns = frame.stamp_us * 1000 + to_unix_ns;
            std::copy(std::begin(pose.t), std::end(pose.t), out.t.begin());
            std::copy(std::begin(pose.q), std::end(pose.q), out.q.begin());
            truth.push_back(out);
        }
        return truth;
    }

    CameraRig rig;
    test::TemporaryFolder scratch;
};

// Promise: a live run gives every frame a right pose at 30 frames/s, at times that are the time of day, and reports the
// camera; depth registered here, by a wrong clock and from YUV, is as good.
TEST_F(LiveProgram, TracksACamera) {
    struct Case {
        std::uint32_t modes, can_register;
        std::int64_t stamp_offset_us;
        const char* device;
    };
    for (const Case& c : {Case{2, 1, 0, "registered by the camera"}, Case{6, 0, 12345678, "registered here"}}) {
        rig.camera().is_plugged = 1;
        rig.camera().modes = c.modes;
        rig.camera().can_register = c.can_register;
        rig.camera().stamp_offset_us = c.stamp_offset_us;
        rig.camera().log_count = 0;
        Program run = start("run --camera auto --frames 90 --json --trajectory " + scratch.path("path.txt"));
        ASSERT_EQ(run.wait(60'000), 0) << run.err();
        const nlohmann::json json = json_of(run);
        EXPECT_EQ(json["frames"], 90);
        EXPECT_GT(json["coverage"], 0.95);
        EXPECT_EQ(json["is_realtime"], true);
        EXPECT_NE(json["camera"]["device"].get<std::string>().find(c.device), std::string::npos) << json["camera"];
        EXPECT_LE(json["camera"]["images_missing"], 20) << "none, on a machine that is not busy";
        EXPECT_NEAR(json["camera"]["lag_mean_ms"].get<double>(), 1.5, 0.01);
        EXPECT_EQ(json["life"]["unplugs"], 0);
        Trajectory estimate;
        std::string message;
        ASSERT_EQ(read_trajectory(scratch.path("path.txt"), estimate, message), Status::kOk) << message;
        Trajectory true_path = truth();
        for (TrajectoryPose& pose : true_path) pose.time_ns -= c.stamp_offset_us * 1000;
        const auto evaluation = evaluate(true_path, estimate);
        ASSERT_TRUE(evaluation.has_value());
        std::printf("%s: ATE %.4f m, latency %.1f ms median\n", c.device, evaluation->ate_rmse_m,
                    json["latency"]["ms_median"].get<double>());
        EXPECT_LT(evaluation->ate_rmse_m, 0.03);
    }
}

// Promise: unplugged, the poses stop, the program says so and goes on; plugged in again it has poses within two
// seconds; the same for a stall, which ends in a reset; lost colour images cost their frames only; Ctrl-C ends it with
// all written.
TEST_F(LiveProgram, SurvivesALife) {
    rig.camera().is_plugged = 1;
    Program run =
        start("run --camera auto --trajectory " + scratch.path("path.txt") + " --report " + scratch.path("report"));
    const auto has_poses = [this](std::size_t count) { return poses("path.txt") >= count; };
    ASSERT_TRUE(within(30'000, [&] { return has_poses(40); })) << run.err();
    rig.camera().is_plugged = 0;
    ASSERT_TRUE(within(5000, [&] { return run.err().find("the camera is gone (unplugged)") != std::string::npos; }))
        << run.err();
    std::this_thread::sleep_for(std::chrono::milliseconds(300));
    const std::size_t at_unplug = poses("path.txt");
    std::this_thread::sleep_for(std::chrono::milliseconds(500));
    EXPECT_EQ(poses("path.txt"), at_unplug) << "poses stop";
    rig.camera().is_plugged = 1;
    const std::int64_t back_ns = test::now_ns();
    ASSERT_TRUE(within(10'000, [&] { return has_poses(at_unplug + 1); })) << run.err();
    const double replug_s = static_cast<double>(test::now_ns() - back_ns) * 1e-9;
    ASSERT_TRUE(within(10'000, [&] { return has_poses(at_unplug + 20); })) << run.err();

    rig.camera().is_stalled = 1;
    ASSERT_TRUE(within(8000, [&] { return run.err().find("no frames for") != std::string::npos; })) << run.err();
    ASSERT_TRUE(within(8000, [&] { return rig.camera().opens >= 3; })) << "closed and opened again";
    const std::size_t at_stall = poses("path.txt");
    rig.camera().is_stalled = 0;
    const std::int64_t flow_ns = test::now_ns();
    ASSERT_TRUE(within(10'000, [&] { return has_poses(at_stall + 1); })) << run.err();
    const double stall_s = static_cast<double>(test::now_ns() - flow_ns) * 1e-9;
    rig.camera().drop_colour_every = 3;
    ASSERT_TRUE(within(10'000, [&] { return has_poses(at_stall + 30); })) << run.err();
    run.signal(SIGINT);
    ASSERT_EQ(run.wait(20'000), 130) << run.err();
    std::printf("poses %.2f s after the replug, %.2f s after the stall\n%s", replug_s, stall_s, run.out().c_str());
    EXPECT_LT(replug_s, 2.0);
    EXPECT_LT(stall_s, 2.0);
    EXPECT_NE(run.out().find("unplugged 1 times"), std::string::npos);
    EXPECT_NE(run.err().find("the camera is back after"), std::string::npos);
    EXPECT_NE(test::text_of(scratch.path("path.txt")).find("# the camera is gone"), std::string::npos);
    EXPECT_TRUE(std::filesystem::exists(scratch.path("report/index.html")));
    EXPECT_EQ(rig.camera().opens, rig.camera().closes);
}

// Promise: a camera whose exposure hunts, by 40 % up and down within a second, is tracked as any other; one of which
// only colour or only depth comes gives no poses, the program says which of them does not come, and goes on when it
// does.
TEST_F(LiveProgram, ExposureHuntsAndStreamsEnd) {
    rig.camera().is_plugged = 1;
    rig.camera().exposure_swing = 40;
    const auto is_whole = [this] {  // false where the machine stood still and the driver lost images
        Program hunted = start("run --camera auto --frames 90 --json --trajectory " + scratch.path("hunted.txt"));
        EXPECT_EQ(hunted.wait(60'000), 0) << hunted.err();
        const auto json = json_of(hunted);
        if (json["camera"]["images_missing"] > 5) return false;
        EXPECT_GT(json["coverage"], 0.95);
        return true;
    };
    int attempts_left = 8;
    while (!is_whole() && --attempts_left > 0) {
    }
    ASSERT_GT(attempts_left, 0) << "images are lost in every run";
    Trajectory estimate;
    std::string message;
    ASSERT_EQ(read_trajectory(scratch.path("hunted.txt"), estimate, message), Status::kOk) << message;
    const auto evaluation = evaluate(truth(), estimate);
    ASSERT_TRUE(evaluation.has_value());
    std::printf("exposure hunting: ATE %.4f m\n", evaluation->ate_rmse_m);
    EXPECT_LT(evaluation->ate_rmse_m, 0.03);
    rig.camera().exposure_swing = 0;

    Program run = start("run --camera auto --json --trajectory " + scratch.path("path.txt"));
    struct Case {
        std::atomic<std::uint32_t>& cause;
        const char* sentence;
    };
    for (const Case& c :
         {Case{rig.camera().drop_depth_every, "(colour images come, depth images do not)"},
          Case{rig.camera().drop_colour_every, "(depth images come, colour images do not)"},
          Case{rig.camera().emits_wrong_size, "(images come, but of another size or format than 320"}}) {
        const std::size_t before = poses("path.txt");
        ASSERT_TRUE(within(30'000, [&] { return poses("path.txt") >= before + 10; })) << run.err();
        c.cause = 1;
        ASSERT_TRUE(within(10'000, [&] { return run.err().find(c.sentence) != std::string::npos; })) << run.err();
        std::size_t at_end = 0;
        EXPECT_TRUE(within(10'000, [&] {  // what was in hand is finished
            at_end = poses("path.txt");
            std::this_thread::sleep_for(std::chrono::milliseconds(300));
            return poses("path.txt") == at_end;
        }));
        c.cause = 0;
        ASSERT_TRUE(within(2'000, [&] { return poses("path.txt") > at_end; })) << run.err();
    }
    run.signal(SIGINT);
    EXPECT_EQ(run.wait(20'000), 130) << run.err();
}

// Promise: a camera whose clock steps back and leaps forward is tracked on, without being called gone; one that comes
// back in another size is not used, which is said, and one that can do both sizes is asked for that of before.
TEST_F(LiveProgram, ClocksAndModesChange) {
    // Stamps count from when the machine was started, and a camera has none before its own start.
    constexpr std::int64_t kBegin_us = 2'000'000'000;
    rig.camera().stamp_offset_us = kBegin_us;
    rig.camera().is_plugged = 1;
    Program run = start("run --camera auto --json --trajectory " + scratch.path("path.txt"));
    const auto has_more_poses = [&](std::size_t count) {
        const std::size_t before = poses("path.txt");
        return within(30'000, [&] { return poses("path.txt") >= before + count; });
    };
    ASSERT_TRUE(has_more_poses(10)) << run.err();
    for (const std::int64_t offset_us : {-1'000'000'000LL, 5'000'000'000LL}) {
        rig.camera().stamp_offset_us = kBegin_us + offset_us;
        ASSERT_TRUE(has_more_poses(10)) << run.err();
    }
    EXPECT_EQ(run.err().find("the camera is gone"), std::string::npos) << run.err();
    const auto comes_back = [this](std::uint32_t modes) {
        const std::uint32_t opens = rig.camera().opens;
        rig.camera().is_plugged = 0;
        EXPECT_TRUE(within(10'000, [&] { return rig.camera().opens == rig.camera().closes; }));
        rig.camera().modes = modes;
        rig.camera().is_plugged = 1;
        EXPECT_TRUE(within(10'000, [&] { return rig.camera().opens > opens; }));
    };
    comes_back(1);
    ASSERT_TRUE(within(10'000, [&] {
        return run.err().find("not as before (640x480 instead of 320x240") != std::string::npos;
    })) << run.err();
    const std::size_t without = poses("path.txt");
    std::this_thread::sleep_for(std::chrono::milliseconds(500));
    EXPECT_EQ(poses("path.txt"), without);
    comes_back(3);
    ASSERT_TRUE(has_more_poses(10)) << run.err();
    run.signal(SIGINT);
    EXPECT_EQ(run.wait(20'000), 130) << run.err();
    const nlohmann::json json = json_of(run);
    EXPECT_GE(json["life"]["clock_restarts"], 2) << json["life"];
    EXPECT_EQ(json["life"]["unplugs"], 1) << json["life"];
}

// Promise: a capture that is ended by a signal, by one during a stall, or by the plug, has written what came before,
// playable; a folder goes on when the camera is back.
TEST_F(LiveProgram, CapturesKeepWhatTheyHave) {
    const auto started = [this](const std::string& out) {
        rig.camera().is_plugged = 1;
        rig.camera().is_stalled = 0;
        rig.camera().log_count = 0;
        auto capture = std::make_unique<Program>(STILLMESH_PROGRAM, STILLMESH_PRIVATE_OPENNI2,
                                                 "capture --camera auto --json --out " + out, scratch);
        EXPECT_TRUE(within(20'000, [this] { return rig.camera().log_count >= 30; })) << capture->err();
        return capture;
    };
    const auto frames_of = [this](const std::string& arguments) {
        Program run = start("run --json " + arguments);
        EXPECT_EQ(run.wait(60'000), 0) << run.err();
        return json_of(run)["frames"].get<int>();
    };
    for (const char* const end : {"signal", "stall", "plug"}) {
        SCOPED_TRACE(end);
        const std::string file = scratch.path(std::string(end) + ".oni");
        const std::unique_ptr<Program> capture = started(file);
        if (*end == 'p') {
            rig.camera().is_plugged = 0;
        } else {
            rig.camera().is_stalled = std::string(end) == "stall" ? 1 : 0;
            std::this_thread::sleep_for(std::chrono::milliseconds(300));
            capture->signal(SIGINT);
        }
        EXPECT_EQ(capture->wait(20'000), *end == 'p' ? 1 : 130) << capture->err();
        EXPECT_EQ(capture->err().find("the recording ends here") != std::string::npos, *end == 'p') << capture->err();
        EXPECT_GE(frames_of("--camera openni2:" + file), 10);
    }
    const std::unique_ptr<Program> folder = started(scratch.path("desk"));
    rig.camera().is_plugged = 0;
    ASSERT_TRUE(within(10'000, [&] { return folder->err().find("is gone (unplugged)") != std::string::npos; }));
    const std::uint32_t before = rig.camera().log_count;
    rig.camera().is_plugged = 1;
    ASSERT_TRUE(within(10'000, [&] { return folder->err().find("is back after") != std::string::npos; }));
    ASSERT_TRUE(within(10'000, [&] { return rig.camera().log_count >= before + 30; }));
    folder->signal(SIGTERM);
    EXPECT_EQ(folder->wait(20'000), 143) << folder->err();
    const int written = json_of(*folder)["frames"];
    EXPECT_GE(written, 20);
    EXPECT_EQ(frames_of("--replay " + scratch.path("desk")), written);
}

// Promise: SIGTERM during a stall ends the program within two seconds, everything written; so does Ctrl-C while it
// waits for a camera that is not there.
TEST_F(LiveProgram, EndsCleanlyDuringAStall) {
    rig.camera().is_plugged = 1;
    Program run = start("run --camera auto --json --trajectory " + scratch.path("path.txt") + " --trajectory-final " +
                        scratch.path("final.txt"));
    ASSERT_TRUE(within(30'000, [&] { return poses("path.txt") >= 10; })) << run.err();
    rig.camera().is_stalled = 1;
    std::this_thread::sleep_for(std::chrono::milliseconds(700));
    run.signal(SIGTERM);
    ASSERT_EQ(run.wait(5000), 143) << run.err();
    EXPECT_EQ(json_of(run)["exit_code"], 143);
    EXPECT_EQ(poses("final.txt"), poses("path.txt"));

    rig.camera().is_stalled = 0;
    rig.camera().is_plugged = 0;
    Program absent = start("run --camera auto --json");
    EXPECT_EQ(absent.wait(20'000), 2);
    EXPECT_NE(absent.err().find("no camera is plugged in that OpenNI2 knows"), std::string::npos) << absent.err();
    Program waiting = start("run --camera auto --wait --json");
    ASSERT_TRUE(within(20'000, [&] { return waiting.err().find("Waiting for one") != std::string::npos; }));
    waiting.signal(SIGINT);
    EXPECT_EQ(waiting.wait(5000), 130) << waiting.err();
    Program patient = start("run --camera auto --wait --json --frames 5");
    ASSERT_TRUE(within(20'000, [&] { return patient.err().find("Waiting for one") != std::string::npos; }));
    rig.camera().is_plugged = 1;
    EXPECT_EQ(patient.wait(20'000), 0) << patient.err();
    EXPECT_EQ(json_of(patient)["frames"], 5);
}

// Promise: where the stalled camera's driver hangs when it is closed, for longer than anybody waits, Ctrl-C ends the
// program all the same, everything written.
TEST_F(LiveProgram, EndsBesideAHangingDriver) {
    rig.camera().is_plugged = 1;
    Program run = start("run --camera auto --json --trajectory " + scratch.path("path.txt") + " --trajectory-final " +
                        scratch.path("final.txt"));
    ASSERT_TRUE(within(30'000, [&] { return poses("path.txt") >= 10; })) << run.err();
    rig.camera().hang_ms = 120'000;
    rig.camera().is_stalled = 1;
    std::this_thread::sleep_for(std::chrono::milliseconds(1500));  // it is being closed
    run.signal(SIGINT);
    EXPECT_EQ(run.wait(20'000), 130) << run.err();
    EXPECT_EQ(json_of(run)["exit_code"], 130);
    EXPECT_EQ(poses("final.txt"), poses("path.txt"));
}

// Promise: an .oni recording is tracked twice with the same bits, and its frames, written as a folder, once more; a
// folder captured from the camera replays too.
TEST_F(LiveProgram, RecordingsAreTrackedAgain) {
    rig.camera().is_plugged = 1;
    Program capture = start("capture --camera auto --frames 45 --json --out " + scratch.path("desk.oni"));
    ASSERT_EQ(capture.wait(30'000), 0) << capture.err();
    EXPECT_EQ(json_of(capture)["frames"], 45);
    Program folder = start("capture --camera auto --frames 20 --json --out " + scratch.path("desk"));
    ASSERT_EQ(folder.wait(30'000), 0) << folder.err();
    rig.camera().is_plugged = 0;
    std::string hashes[3];
    for (const int i : {0, 1}) {
        Program run = start("run --json --camera openni2:" + scratch.path("desk.oni") +
                            (i == 1 ? " --record-frames " + scratch.path("again") : ""));
        ASSERT_EQ(run.wait(60'000), 0) << run.err();
        const nlohmann::json json = json_of(run);
        EXPECT_GE(json["frames"], 40);
        EXPECT_EQ(json["coverage"], 1.0);
        EXPECT_EQ(json["is_realtime"], false);
        hashes[i] = json["state_hash"];
    }
    Program again = start("run --json --replay " + scratch.path("again"));
    ASSERT_EQ(again.wait(60'000), 0) << again.err();
    hashes[2] = json_of(again)["state_hash"];
    EXPECT_EQ(hashes[0], hashes[1]);
    EXPECT_EQ(hashes[0], hashes[2]);
    Program replay = start("run --json --replay " + scratch.path("desk"));
    ASSERT_EQ(replay.wait(60'000), 0) << replay.err();
    EXPECT_EQ(json_of(replay)["frames"], 20);
}

#ifdef STILLMESH_HAS_BAGS
// Promise: a capture into a bag that is killed, without any time to end, leaves a bag of whole frames that plays.
TEST_F(LiveProgram, AKilledCaptureLeavesABag) {
    rig.camera().is_plugged = 1;
    const std::string bag = scratch.path("desk.mcap");
    Program capture = start("capture --camera auto --out " + bag);
    const auto bytes = [&bag] {
        std::error_code error;
        const std::uintmax_t size = std::filesystem::file_size(bag, error);
        return error ? 0 : size;
    };
    ASSERT_TRUE(within(30'000, [&] { return bytes() > 10'000'000; })) << capture.err();
    capture.signal(SIGKILL);
    static_cast<void>(capture.wait(20'000));
    rig.camera().is_plugged = 0;
    Program replay = start("run --json --replay " + bag);
    const int code = replay.wait(60'000);
    EXPECT_TRUE(code == 0 || code == 1) << replay.err();
    EXPECT_GE(json_of(replay)["frames"], 4) << replay.err();
}
#endif

// Promise: injected faults change with their seed and not otherwise; the run goes on through all of them and says what
// they were. Wrong names of cameras are refused with the right ones.
TEST_F(LiveProgram, InjectedFaultsAndWrongNames) {
    rig.camera().is_plugged = 1;
    Program run = start("run --camera auto --inject 4 --json --frames 60");
    const int code = run.wait(90'000);
    EXPECT_TRUE(code == 0 || code == 1) << code << run.err();
    EXPECT_EQ(json_of(run)["frames"], 60);
    EXPECT_TRUE(json_of(run)["faults"].is_string());
    for (const char* const name : {"webcam", "openni2:", "openni2x"}) {
        Program wrong = start(std::string("run --camera ") + name);
        EXPECT_EQ(wrong.wait(20'000), 2);
        EXPECT_NE(wrong.err().find("openni2:FILE.oni"), std::string::npos) << wrong.err();
    }
    Program other = start("run --camera openni2:NOSUCH");
    EXPECT_EQ(other.wait(20'000), 2);
    EXPECT_NE(other.err().find("there are: stillmesh://0 (serial TEST0001)."), std::string::npos) << other.err();
    Program nowhere = start("capture --camera auto --out " + scratch.path("no/such/folder.oni"));
    EXPECT_EQ(nowhere.wait(20'000), 2);
    EXPECT_NE(nowhere.err().find("cannot be written: No such file or directory."), std::string::npos) << nowhere.err();
}

}  // namespace
}  // namespace stillmesh::program_test
