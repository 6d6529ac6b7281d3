#include "hal/openni2/openni2_camera.hpp"

#include <gtest/gtest.h>

#include "tests/openni2/rig.hpp"

namespace stillmesh::openni2_camera_test {
namespace {

using test::CameraRig;
using test::within;

// The next frame within a time; the status of the last poll else.
Status next(OpenNi2Camera& camera, Frame& frame, std::int64_t timeout_ms = 1000) {
    const std::int64_t end_ns = test::now_ns() + timeout_ms * 1'000'000;
    for (;;) {
        const Status status = camera.poll(frame);
        if (status != Status::kTimedOut || test::now_ns() > end_ns) return status;
        static_cast<void>(camera.wait(50));
    }
}

// Tried again where the machine was late; what is wrong however late it was, each attempt says itself.
bool succeeds_in_time(CameraRig& rig, bool (*attempt)(CameraRig&)) {
    constexpr int kAttempts = 60;
    for (int i = 0; i < kAttempts; ++i) {
        if (attempt(rig)) return true;
    }
    return false;
}

// Twenty frames of a camera that was just opened. False: frames were late or lost, as where the machine stood still.
bool serves_what_the_driver_serves(CameraRig& rig) {
    constexpr std::int64_t kStall_ns = 50'000'000;
    OpenNi2Camera camera({});
    EXPECT_EQ(camera.open(), Status::kOk) << camera.message();
    const CameraInfo& info = camera.info();
    EXPECT_EQ(info.model.width, 320U);
    EXPECT_EQ(info.model.height, 240U);
    EXPECT_NEAR(info.model.fx, rig.head().fx, 0.01);
    EXPECT_EQ(info.model.cx, 159.5);
    EXPECT_EQ(info.depth_units_per_m, 1000.0);
    EXPECT_EQ(info.frames_per_s, 30.0);
    EXPECT_EQ(rig.camera().is_mirroring, 0U);
    EXPECT_EQ(rig.camera().is_registering, 1U);
    std::int64_t last_ns = 0;
    for (int i = 0; i < 20; ++i) {
        Frame frame;
        const Status status = next(camera, frame);
        if (status == Status::kTimedOut) return false;
        EXPECT_EQ(status, Status::kOk) << camera.message();
        const std::int64_t late_ns = test::now_ns(CLOCK_REALTIME) - frame.time_ns;
        if (late_ns > kStall_ns) return false;
        EXPECT_GE(late_ns, 0);
        EXPECT_GT(frame.time_ns, last_ns);
        last_ns = frame.time_ns;
        EXPECT_EQ(frame.depth_time_ns - frame.time_ns, 1'500'000);
        EXPECT_EQ(frame.format, PixelFormat::kRgb8);
        const int index = rig.shown_at(camera.due_ns() / 1000);
        if (index < 0) return false;  // the driver stamps with the host's clock, and that is known
        long wrong = 0;
        for (std::uint32_t y = 0; y < 240; ++y) {
            for (std::uint32_t x = 0; x < 320; ++x) {
                const std::size_t at = std::size_t{y} * 320 + x;
                wrong += frame.colour.row(y)[3 * x] != rig.grey(static_cast<std::uint32_t>(index))[at];
                wrong += frame.depth.at(x, y) != rig.depth_mm(static_cast<std::uint32_t>(index))[at];
            }
        }
        EXPECT_EQ(wrong, 0);
    }
    EXPECT_NEAR(camera.counts().pairing.lag_mean_ms(), 1.5, 0.001);
    return camera.counts().dropped == 0 && camera.counts().images_missing == 0;
}

// Promise: the first camera found is opened upright and registered, and its pixels are the driver's, bit for bit,
// stamped in the host's time; on a machine that keeps up none is lost.
TEST(OpenNi2Camera, ServesWhatTheDriverServes) {
    CameraRig rig(STILLMESH_SMALL_FRAMES);
    rig.camera().is_plugged = 1;
    EXPECT_TRUE(succeeds_in_time(rig, serves_what_the_driver_serves))
        << "never twenty frames on end in time, known and whole";
}

// Pixels of a frame that are not the rendered frame's.
long wrong_pixels(const CameraRig& rig, const Frame& frame, std::uint32_t index) {
    long wrong = 0;
    const std::uint32_t channels = channels_of(frame.format);
    for (std::uint32_t y = 0; y < frame.colour.height; ++y) {
        for (std::uint32_t x = 0; x < frame.colour.width; ++x) {
            const std::size_t at = std::size_t{y} * frame.colour.width + x;
            wrong += frame.colour.row(y)[channels * x] != rig.grey(index)[at];
            wrong += frame.depth.at(x, y) != rig.depth_mm(index)[at];
        }
    }
    return wrong;
}

// Which of the rendered frames this is, to the last pixel of both images; -1: none.
int rendered_index(const CameraRig& rig, const Frame& frame) {
    for (std::uint32_t i = 0; i < rig.head().count; ++i) {
        if (wrong_pixels(rig, frame, i) == 0) return static_cast<int>(i);
    }
    return -1;
}

// Promise: nobody is served but by the camera asked for: by URI, by serial number, the first; and what is not there is
// named, with what is.
TEST(OpenNi2Camera, ChoosesByUriOrSerial) {
    CameraRig rig(STILLMESH_SMALL_FRAMES);
    {
        OpenNi2Camera none({});
        EXPECT_EQ(none.open(), Status::kUnavailable);
        EXPECT_NE(none.message().find("no camera is plugged in"), std::string::npos) << none.message();
    }
    rig.camera(0).is_plugged = rig.camera(1).is_plugged = 1;
    {
        OpenNi2Camera second({.device = "stillmesh://1"});
        ASSERT_EQ(second.open(), Status::kOk) << second.message();
        EXPECT_EQ(rig.camera(0).opens, 0U) << "another camera was touched";
    }
    for (const char* const name : {"auto", "stillmesh://0", "TEST0001", "stillmesh://1", "TEST0002"}) {
        OpenNi2Camera camera({.device = name});
        ASSERT_EQ(camera.open(), Status::kOk) << name << camera.message();
        const bool is_second = std::string(name).find('1', 12) != std::string::npos || std::string(name) == "TEST0002";
        EXPECT_NE(camera.device().find(is_second ? "stillmesh://1, serial TEST0002" : "stillmesh://0, serial TEST0001"),
                  std::string::npos)
            << camera.device();
    }
    OpenNi2Camera other({.device = "TEST0003"});
    EXPECT_EQ(other.open(), Status::kUnavailable);
    EXPECT_NE(other.message().find("stillmesh://0 (serial TEST0001), stillmesh://1 (serial TEST0002)."),
              std::string::npos)
        << other.message();
    rig.camera(0).does_open_fail = 1;
    rig.camera(1).is_plugged = 0;
    OpenNi2Camera denied({});
    ASSERT_TRUE(within(1000, [&] {
        return denied.open() == Status::kUnavailable && denied.message().find("permission denied") != std::string::npos;
    })) << denied.message();
    EXPECT_EQ(rig.camera(0).opens, rig.camera(0).closes);
    EXPECT_EQ(rig.camera(1).opens, rig.camera(1).closes);
}

// Promise: opened again after an unplug, it is the camera of before or none, though another one is there and its own
// URI has changed, as bus addresses do: known by its serial number, and without one as the only one of its kind.
TEST(OpenNi2Camera, ComesBackAsItself) {
    for (const bool has_serial : {true, false}) {
        CameraRig rig(STILLMESH_SMALL_FRAMES);
        for (const std::uint32_t i : {0U, 1U}) {
            rig.camera(i).has_no_serial = has_serial ? 0 : 1;
            rig.camera(i).address = 4 + i;
        }
        rig.camera(0).is_plugged = 1;
        OpenNi2Camera camera({.device = has_serial ? "auto" : "1d27/0601@1/4"});
        ASSERT_EQ(camera.open(), Status::kOk) << camera.message();
        Frame frame;
        rig.camera(0).is_plugged = 0;
        ASSERT_TRUE(within(2000, [&] { return camera.poll(frame) == Status::kUnavailable; }));
        camera.close();
        EXPECT_EQ(camera.open(), Status::kUnavailable);
        if (has_serial) {
            rig.camera(1).is_plugged = 1;
            EXPECT_FALSE(within(60, [&] { return camera.open() == Status::kOk; }))
                << "another one: " << camera.device();
        }
        rig.camera(0).address = 7;
        rig.camera(0).is_plugged = 1;
        ASSERT_TRUE(within(2000, [&] { return camera.open() == Status::kOk; })) << camera.message();
        EXPECT_EQ(camera.usb_place(), "1d27/0601@1/7");
        EXPECT_TRUE(within(2000, [&] { return camera.poll(frame) == Status::kOk; }));
        camera.close();
        if (!has_serial) {  // two of its kind, and nothing tells them apart
            rig.camera(0).is_plugged = 0;
            rig.camera(1).is_plugged = 1;
            ASSERT_TRUE(within(2000, [&] { return camera.open() == Status::kOk; })) << "the only one of its kind";
            camera.close();
            rig.camera(1).is_plugged = 0;
            ASSERT_TRUE(within(2000, [&] { return camera.open() == Status::kUnavailable; }));
            rig.camera(0).address = rig.camera(1).address = 9;
            rig.camera(0).is_plugged = rig.camera(1).is_plugged = 1;
            EXPECT_FALSE(within(60, [&] { return camera.open() == Status::kOk; })) << camera.device();
        }
    }
}

// Promise: opened again, a camera is asked for the size it had, though it offers a larger one now; where that is gone
// it says what it found instead.
TEST(OpenNi2Camera, ComesBackInItsSize) {
    CameraRig rig(STILLMESH_LARGE_FRAMES);
    rig.camera().is_plugged = 1;
    OpenNi2Camera camera({});
    struct Case {
        std::uint32_t modes, width;
    };
    for (const Case& c : {Case{2, 320}, Case{3, 320}, Case{1, 640}, Case{3, 320}, Case{2, 320}}) {
        rig.camera().modes = c.modes;
        ASSERT_TRUE(within(2000, [&] { return camera.open() == Status::kOk; })) << camera.message();
        EXPECT_EQ(camera.info().model.width, c.width) << c.modes;
        EXPECT_EQ(camera.info().model.height, c.width * 3 / 4);
        Frame frame;
        EXPECT_TRUE(within(2000, [&] { return camera.poll(frame) == Status::kOk; }));
        EXPECT_EQ(frame.depth.width, c.width);
        camera.close();
    }
}

// Half a second without a poll. False: the driver or the camera's thread was late, as where the machine stood still.
bool newest_wins(CameraRig& rig) {
    constexpr std::int64_t kOld_ns = 150'000'000;
    constexpr std::uint64_t kDroppedMin = 5;  // 14, on a machine that is not busy
    OpenNi2Camera camera({});
    EXPECT_EQ(camera.open(), Status::kOk) << camera.message();
    Frame held;
    if (next(camera, held) != Status::kOk) return false;
    const int held_index = rendered_index(rig, held);
    EXPECT_GE(held_index, 0);
    const std::int64_t begin_ns = camera.due_ns();
    std::this_thread::sleep_for(std::chrono::milliseconds(500));
    EXPECT_EQ(rendered_index(rig, held), held_index) << "the frame in use was touched";
    const std::int64_t before_ns = test::now_ns();
    Frame newest;
    if (camera.poll(newest) != Status::kOk) return false;
    const bool is_new = before_ns - camera.due_ns() < kOld_ns;
    const std::uint64_t dropped = camera.counts().dropped;
    EXPECT_LE(static_cast<std::int64_t>(dropped), (test::now_ns() - begin_ns) / 33'000'000 + 1);
    return is_new && dropped >= kDroppedMin && camera.poll(newest) == Status::kTimedOut;
}

// Promise: a camera that is never polled in time costs the newest frame nothing: it is there, the ones before it are
// dropped and counted, and the frame in use is not touched.
TEST(OpenNi2Camera, NewestWinsAndDropsAreCounted) {
    CameraRig rig(STILLMESH_SMALL_FRAMES);
    rig.camera().is_plugged = 1;
    EXPECT_TRUE(succeeds_in_time(rig, newest_wins))
        << "the newest was never there, or those before it were not counted";
}

// Promise: without 640x480 it is 320x240, and everything that depends on the size follows; without either, and without
// colour formats it can use, it says what the device offers.
TEST(OpenNi2Camera, FollowsTheModesOfTheDevice) {
    CameraRig rig(STILLMESH_SMALL_FRAMES);
    rig.camera().is_plugged = 1;
    OpenNi2Camera small({.device = "", .calibration = "kinect"});
    ASSERT_EQ(small.open(), Status::kOk) << small.message();
    EXPECT_EQ(small.info().model.width, 320U);
    EXPECT_DOUBLE_EQ(small.info().model.fx, 525.0 / 2);
    EXPECT_DOUBLE_EQ(small.info().model.cx, 159.5);
    EXPECT_DOUBLE_EQ(small.info().readout_s, 0.026);
    small.close();
    OpenNi2Camera limited({.device = "", .calibration = "", .width_max = 160, .height_max = 120});
    EXPECT_EQ(limited.open(), Status::kInvalid);
    EXPECT_NE(limited.message().find("320x240@30"), std::string::npos) << limited.message();
    rig.camera().modes = 6;  // YUYV
    OpenNi2Camera yuv({});
    ASSERT_EQ(yuv.open(), Status::kOk) << yuv.message();
    Frame frame;
    ASSERT_EQ(next(yuv, frame), Status::kOk);
    EXPECT_EQ(frame.format, PixelFormat::kGrey8);
    EXPECT_GE(rendered_index(rig, frame), 0);
    yuv.close();
    rig.camera().modes = 0;
    OpenNi2Camera none({});
    EXPECT_EQ(none.open(), Status::kInvalid);
    EXPECT_NE(none.message().find("offers no mode"), std::string::npos) << none.message();
}

// Promise: images of a device that mirrors whatever it is told are turned round here; exposure is as asked for.
TEST(OpenNi2Camera, TurnsMirroredImagesRound) {
    CameraRig rig(STILLMESH_SMALL_FRAMES);
    rig.camera().is_plugged = 1;
    rig.camera().can_unmirror = 0;
    OpenNi2Options options;
    options.exposure = Exposure::kFixed;
    OpenNi2Camera camera(options);
    ASSERT_EQ(camera.open(), Status::kOk);
    Frame frame;
    ASSERT_EQ(next(camera, frame), Status::kOk);
    EXPECT_GE(rendered_index(rig, frame), 0);
    EXPECT_EQ(rig.camera().auto_exposure, 0U);
}

// Promise: where the device cannot register, depth is where the colour camera sees it: nearly all pixels as rendered
// from there, and hardly any that shine through from behind.
TEST(OpenNi2Camera, RegistersHereWhereTheDeviceCannot) {
    CameraRig rig(STILLMESH_SMALL_FRAMES);
    rig.camera().is_plugged = 1;
    rig.camera().can_register = 0;
    OpenNi2Camera camera({});
    ASSERT_EQ(camera.open(), Status::kOk);
    ASSERT_EQ(camera.notes().size(), 1U);
    Frame frame;
    ASSERT_EQ(next(camera, frame), Status::kOk);
    // Known by its colour, which is as rendered.
    std::uint32_t index = 0;
    const auto is_colour_of = [&](std::uint32_t i) {
        for (std::size_t at = 0; at < rig.pixels(); ++at) {
            if (frame.colour.data[3 * at] != rig.grey(i)[at]) return false;
        }
        return true;
    };
    while (index < rig.head().count && !is_colour_of(index)) ++index;
    ASSERT_LT(index, rig.head().count);
    long both = 0, near_truth = 0, behind = 0, raw_near_truth = 0;
    for (std::size_t i = 0; i < rig.pixels(); ++i) {
        const int truth = rig.depth_mm(index)[i];
        const int here = frame.depth.data[i];
        const int raw = rig.raw_depth_mm(index)[i];
        if (truth == 0 || here == 0) continue;
        ++both;
        near_truth += std::abs(here - truth) <= 20 + truth / 40;
        behind += here > truth + 300;
        raw_near_truth += std::abs(raw - truth) <= 20 + truth / 40;
    }
    std::printf("both %ld of %zu, right %.3f, behind %.4f; without registration right %.3f\n", both, rig.pixels(),
                static_cast<double>(near_truth) / static_cast<double>(both),
                static_cast<double>(behind) / static_cast<double>(both),
                static_cast<double>(raw_near_truth) / static_cast<double>(both));
    EXPECT_GT(both, static_cast<long>(rig.pixels()) * 7 / 10);
    EXPECT_GT(near_truth * 100, both * 95);
    EXPECT_LT(behind * 100, both * 2);
    EXPECT_LT(raw_near_truth, near_truth);
}

// Promise: pairs are made by time: lost colour or depth images cost their pair and no other, and never shift it.
TEST(OpenNi2Camera, PairsSurviveLostImages) {
    CameraRig rig(STILLMESH_SMALL_FRAMES);
    rig.camera().is_plugged = 1;
    rig.camera().drop_colour_every = 4;
    rig.camera().drop_depth_every = 5;
    rig.camera().depth_lag_us = 9000;
    OpenNi2Camera camera({});
    ASSERT_EQ(camera.open(), Status::kOk);
    for (int i = 0; i < 24; ++i) {
        Frame frame;
        ASSERT_EQ(next(camera, frame), Status::kOk);
        EXPECT_EQ(frame.depth_time_ns - frame.time_ns, 9'000'000);
        EXPECT_GE(rendered_index(rig, frame), 0);
    }
    const LiveCounts counts = camera.counts();
    EXPECT_GT(counts.pairing.colour_alone, 3U);
    EXPECT_GT(counts.pairing.depth_alone, 3U);
    EXPECT_GT(counts.images_missing, 6U) << "the driver's numbers say so";
    EXPECT_NEAR(counts.pairing.lag_mean_ms(), 9.0, 1e-6);
}

// Promise: unplugged, poll says so within a moment; plugged in again it can be opened again; wait is always bounded.
TEST(OpenNi2Camera, UnpluggedAndBack) {
    CameraRig rig(STILLMESH_SMALL_FRAMES);
    rig.camera().is_plugged = 1;
    OpenNi2Camera camera({});
    ASSERT_EQ(camera.open(), Status::kOk);
    Frame frame;
    ASSERT_EQ(next(camera, frame), Status::kOk);
    rig.camera().is_plugged = 0;
    const std::int64_t begin_ns = test::now_ns();
    while (next(camera, frame) == Status::kOk) {
    }
    EXPECT_EQ(camera.poll(frame), Status::kUnavailable);
    EXPECT_LT(test::now_ns() - begin_ns, 500'000'000);
    camera.close();
    EXPECT_EQ(camera.open(), Status::kUnavailable);
    rig.camera().is_plugged = 1;
    ASSERT_TRUE(within(1000, [&] { return camera.open() == Status::kOk; }));
    EXPECT_EQ(next(camera, frame), Status::kOk);
    rig.camera().is_stalled = 1;
    while (next(camera, frame, 150) == Status::kOk) {
    }
    const std::int64_t stall_ns = test::now_ns();
    EXPECT_EQ(camera.wait(100), Status::kTimedOut);
    EXPECT_LT(test::now_ns() - stall_ns, 400'000'000);
}

// Promise: images of another size than the mode's are refused, one by one, and the camera goes on.
TEST(OpenNi2Camera, RefusesWrongSizes) {
    CameraRig rig(STILLMESH_SMALL_FRAMES);
    rig.camera().is_plugged = 1;
    OpenNi2Camera camera({});
    ASSERT_EQ(camera.open(), Status::kOk);
    Frame frame;
    ASSERT_EQ(next(camera, frame), Status::kOk);
    rig.camera().emits_wrong_size = 1;
    ASSERT_TRUE(within(1000, [&] { return next(camera, frame) == Status::kCorrupt; }));
    EXPECT_NE(camera.message().find("another size"), std::string::npos) << camera.message();
    rig.camera().emits_wrong_size = 0;
    EXPECT_TRUE(within(1000, [&] { return next(camera, frame) == Status::kOk; }));
}

// Promise: a driver that hangs while it is closed, or opened, costs its time limit and no more; the camera can be
// opened later, and what was left behind closes by itself.
TEST(OpenNi2Camera, AHangingDriverIsLeftBehind) {
    CameraRig rig(STILLMESH_SMALL_FRAMES);
    rig.camera().is_plugged = 1;
    OpenNi2Options options;
    options.open_max_ms = 300;
    {
        OpenNi2Camera camera(options);
        ASSERT_TRUE(within(2000, [&] { return camera.open() == Status::kOk; }));
        rig.camera().hang_ms = 1500;
        const std::int64_t begin_ns = test::now_ns();
        camera.close();
        EXPECT_LT(test::now_ns() - begin_ns, 1'000'000'000);
        EXPECT_NE(camera.message().find("does not answer"), std::string::npos);
        rig.camera().hang_ms = 0;
        EXPECT_TRUE(within(5000, [&] { return camera.open() == Status::kOk; }));
        camera.close();
        rig.camera().open_hang_ms = 1500;
        const std::int64_t again_ns = test::now_ns();
        EXPECT_EQ(camera.open(), Status::kUnavailable);
        EXPECT_LT(test::now_ns() - again_ns, 1'000'000'000);
        EXPECT_NE(camera.message().find("does not answer"), std::string::npos) << camera.message();
        rig.camera().open_hang_ms = 0;
        Frame frame;
        EXPECT_TRUE(within(5000, [&] { return camera.open() == Status::kOk && next(camera, frame) == Status::kOk; }));
    }
    EXPECT_TRUE(within(5000, [&] { return rig.camera().opens >= 4 && rig.camera().opens == rig.camera().closes; }))
        << rig.camera().opens << " opened, " << rig.camera().closes << " closed";
}

// Promise: what is recorded into an .oni file comes out of it again, each pair once, pixel by pixel but for what
// OpenNI2's compression loses; then it ends, without hanging; a second time it is the same.
TEST(OpenNi2Camera, RecordsAndPlaysOniFiles) {
    CameraRig rig(STILLMESH_SMALL_FRAMES);
    rig.camera().is_plugged = 1;
    const test::TemporaryFolder folder;
    const std::string file = folder.path("desk.oni");
    OpenNi2Options options;
    options.record = file;
    {
        OpenNi2Camera camera(options);
        ASSERT_EQ(camera.open(), Status::kOk) << camera.message();
        for (int i = 0; i < 30; ++i) {
            Frame frame;
            ASSERT_EQ(next(camera, frame), Status::kOk);
        }
    }
    rig.camera().is_plugged = 0;
    std::vector<std::int64_t> times[2];
    for (std::vector<std::int64_t>& list : times) {
        OpenNi2Camera camera({.device = file});
        ASSERT_EQ(camera.open(), Status::kOk) << camera.message();
        EXPECT_EQ(camera.info().model.width, 320U);
        EXPECT_NEAR(camera.info().model.fx, rig.head().fx, 0.01);
        int index = -1;
        Frame frame;
        Status status = Status::kOk;
        while ((status = camera.poll(frame)) == Status::kOk) {
            // Images that a busy machine lost are in no file: then it is one of those that follow.
            int shown = index + 1;
            const auto is_shown = [&] {
                return wrong_pixels(rig, frame, static_cast<std::uint32_t>(shown)) <= test::kDepthPixelsLost;
            };
            while (shown < static_cast<int>(rig.head().count) && !is_shown()) ++shown;
            ASSERT_LT(shown, static_cast<int>(rig.head().count))
                << "frame " << list.size() << " is none of the rendered";
            index = shown;
            list.push_back(frame.time_ns);
        }
        EXPECT_EQ(status, Status::kEnd);
        EXPECT_GE(list.size(), 27U);
        EXPECT_EQ(camera.poll(frame), Status::kEnd);
        EXPECT_TRUE(std::is_sorted(list.begin(), list.end()));
    }
    EXPECT_EQ(times[0], times[1]);

    // Torn files are refused or play their part, without hanging.
    std::FILE* const stream = std::fopen(file.c_str(), "rb");
    ASSERT_NE(stream, nullptr);
    std::vector<char> bytes(200'000'000);
    bytes.resize(std::fread(bytes.data(), 1, bytes.size(), stream));
    std::fclose(stream);
    for (const std::size_t size :
         {std::size_t{0}, std::size_t{3}, std::size_t{100}, bytes.size() / 5, bytes.size() - 7}) {
        std::FILE* const torn = std::fopen(file.c_str(), "wb");
        ASSERT_EQ(std::fwrite(bytes.data(), 1, size, torn), size);
        std::fclose(torn);
        OpenNi2Camera camera({.device = file});
        // What the camera takes; comparing pixels may take any time.
        std::int64_t slowest_ns = 0;
        const auto clocked = [&slowest_ns](auto&& call) {
            const std::int64_t begin_ns = test::now_ns();
            const Status status = call();
            slowest_ns = std::max(slowest_ns, test::now_ns() - begin_ns);
            return status;
        };
        const Status opened = clocked([&] { return camera.open(); });
        std::uint64_t frames = 0;
        if (opened == Status::kOk) {
            Frame frame;
            while (frames < 1000 && clocked([&] { return camera.poll(frame); }) == Status::kOk) {
                long best = 1000000;
                for (std::uint32_t i = 0; i < rig.head().count; ++i) best = std::min(best, wrong_pixels(rig, frame, i));
                EXPECT_LE(best, test::kDepthPixelsLost) << "no frame is made up";
                ++frames;
            }
        } else {
            EXPECT_EQ(opened, Status::kInvalid);
            EXPECT_NE(camera.message().find(file), std::string::npos) << camera.message();
        }
        EXPECT_LT(slowest_ns, 5'000'000'000);
        std::printf("%zu bytes: %s, %llu frames; %s\n", size, status_name(opened),
                    static_cast<unsigned long long>(frames), camera.message().c_str());
    }
    OpenNi2Camera absent({.device = "absent.oni"});
    EXPECT_EQ(absent.open(), Status::kInvalid);
}

}  // namespace
}  // namespace stillmesh::openni2_camera_test
