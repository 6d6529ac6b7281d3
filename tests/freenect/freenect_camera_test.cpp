// FreenectCamera over a scripted libfreenect: the slot, the times, and what goes wrong.
#include "hal/freenect/freenect_camera.hpp"

#include <gtest/gtest.h>

#include <chrono>
#include <cmath>
#include <thread>

#include "tests/freenect/scripted_freenect.hpp"

namespace stillmesh::freenect_camera_test {
namespace {

using Clock = std::chrono::steady_clock;
using test::scripted_kinect;

class FreenectCameraTest : public ::testing::Test {
protected:
    FreenectCameraTest() {
        scripted_kinect.devices = 1;
        scripted_kinect.is_registered = true;
        scripted_kinect.refuses_open = scripted_kinect.hangs = scripted_kinect.is_silent = false;
        scripted_kinect.stamp = 1000;
        scripted_kinect.pairs = 0;
    }
    ~FreenectCameraTest() override {
        // Threads that were left behind end now.
        scripted_kinect.hangs = false;
        const Clock::time_point until = Clock::now() + std::chrono::seconds(5);
        while (scripted_kinect.contexts > 0 && Clock::now() < until) sleep_ms(1);
        EXPECT_EQ(scripted_kinect.contexts, 0);
        EXPECT_EQ(scripted_kinect.open_devices, 0);
    }
    static void sleep_ms(int time_ms) { std::this_thread::sleep_for(std::chrono::milliseconds(time_ms)); }
    // The next frame, within a second.
    [[nodiscard]] static Status next(FreenectCamera& camera, Frame& frame) {
        const Status waited = camera.wait(1000);
        return waited == Status::kOk ? camera.poll(frame) : waited;
    }
    [[nodiscard]] static double seconds_since(Clock::time_point begin) {
        return std::chrono::duration<double>(Clock::now() - begin).count();
    }
};

// Promise: registered millimetres come as they are, with colour of the same instant, upright in size and form, and the
// pixels stay while newer ones arrive; the newest wins, and what was overtaken is counted.
TEST_F(FreenectCameraTest, NewestFrameWithoutCopy) {
    FreenectCamera camera;
    Frame frame;
    EXPECT_EQ(camera.poll(frame), Status::kUnavailable);
    ASSERT_EQ(camera.open(), Status::kOk) << camera.message();
    EXPECT_TRUE(camera.is_registered_by_driver());
    EXPECT_EQ(scripted_kinect.subdevices, 2U) << "the camera alone, not the motor";
    EXPECT_EQ(camera.info().model.width, 640U);
    EXPECT_EQ(camera.info().depth_units_per_m, 1000.0);
    EXPECT_GT(camera.info().readout_s, 0);
    std::uint32_t last = 0;
    std::int64_t last_ns = 0;
    for (int i = 0; i < 5; ++i) {
        sleep_ms(110);  // some are overtaken
        ASSERT_EQ(next(camera, frame), Status::kOk);
        ASSERT_EQ(frame.depth.width, 640U);
        ASSERT_EQ(frame.colour.height, 480U);
        EXPECT_EQ(frame.format, PixelFormat::kRgb8);
        const std::uint32_t number = frame.depth.row(0)[0] - 1000U;
        EXPECT_NE(number, last);
        last = number;
        EXPECT_EQ(frame.colour.row(0)[0], number) << "colour and depth of different instants";
        EXPECT_EQ(frame.depth_time_ns - frame.time_ns, 5'000'000);
        EXPECT_GT(frame.time_ns, last_ns);
        last_ns = frame.time_ns;
        sleep_ms(110);  // newer ones come; these pixels stay
        for (std::uint32_t y = 0; y < 480; ++y) {
            ASSERT_EQ(frame.depth.row(y)[y], number + 1000U);
            ASSERT_EQ(frame.colour.row(y)[3 * y], number);
        }
    }
    EXPECT_EQ(camera.poll(frame), Status::kOk);
    EXPECT_GT(camera.dropped(), 5U);
    EXPECT_EQ(camera.counts().pairing.colour_alone, 0U);
    camera.close();
    EXPECT_EQ(camera.poll(frame), Status::kUnavailable);
    EXPECT_EQ(scripted_kinect.open_devices, 0);
}

// Promise: the timestamps' wrap after 71 s is none of the user's business.
TEST_F(FreenectCameraTest, TimestampsWrap) {
    scripted_kinect.stamp = 0U - 5'000'000U;
    FreenectCamera camera;
    ASSERT_EQ(camera.open(), Status::kOk) << camera.message();
    Frame frame;
    std::int64_t last_ns = 0;
    for (int i = 0; i < 10; ++i) {
        ASSERT_EQ(next(camera, frame), Status::kOk);
        if (i > 0) {
            const std::int64_t passed_us = (frame.time_ns - last_ns) / 1000;
            const std::int64_t periods = (passed_us + 16'666) / 33'333;
            EXPECT_GE(periods, 1) << i;
            EXPECT_NEAR(static_cast<double>(passed_us), 33'333.3 * static_cast<double>(periods), 3) << i;
            EXPECT_LT(periods, 100) << i;
        }
        EXPECT_EQ(frame.depth_time_ns - frame.time_ns, 5'000'000);
        last_ns = frame.time_ns;
    }
}

// Promise: a libfreenect without registered depth gives raw values, which become registered millimetres here.
TEST_F(FreenectCameraTest, RegistersHereWhereItMust) {
    scripted_kinect.is_registered = false;
    FreenectCamera camera;
    ASSERT_EQ(camera.open(), Status::kOk) << camera.message();
    EXPECT_FALSE(camera.is_registered_by_driver());
    Frame frame;
    ASSERT_EQ(next(camera, frame), Status::kOk);
    ASSERT_LT(frame.colour.row(0)[0], 50);  // raw values above 1050 are far away
    const std::uint16_t raw = static_cast<std::uint16_t>(1000 + frame.colour.row(0)[0]);
    EXPECT_EQ(frame.depth.row(240)[320], kinect_millimetres(raw));
}

// Promise: raw values become metres as measured by others (S. Magnenat's fit on OpenKinect's wiki),
// nearer than 2 % from 0.5 to 3.2 m, and what is
// no depth stays none.
TEST(KinectMillimetres, AgreesWithMeasurements) {
    for (std::uint16_t raw = 450; raw <= 980; raw = static_cast<std::uint16_t>(raw + 10)) {
        const double wiki_mm = 123.6 * std::tan(raw / 2842.5 + 1.1863);
        EXPECT_NEAR(kinect_millimetres(raw), wiki_mm, 0.02 * wiki_mm) << raw;
    }
    for (std::uint16_t raw = 400; raw < 1050; ++raw) {
        EXPECT_LE(kinect_millimetres(raw), kinect_millimetres(static_cast<std::uint16_t>(raw + 1))) << raw;
    }
    for (const int raw : {0, 1089, 1100, 2046, 2047, 2048, 65535}) {
        EXPECT_EQ(kinect_millimetres(static_cast<std::uint16_t>(raw)), 0) << raw;
    }
}

// Promise: no Kinect, and one that cannot be opened, are told apart; both can be tried again.
TEST_F(FreenectCameraTest, AbsentOrRefused) {
    FreenectCamera camera;
    scripted_kinect.devices = 0;
    EXPECT_EQ(camera.open(), Status::kUnavailable);
    EXPECT_NE(camera.message().find("no Kinect is plugged in"), std::string::npos) << camera.message();
    scripted_kinect.devices = 1;
    scripted_kinect.refuses_open = true;
    EXPECT_EQ(camera.open(), Status::kUnavailable);
    EXPECT_NE(camera.message().find("cannot be opened"), std::string::npos) << camera.message();
    scripted_kinect.refuses_open = false;
    EXPECT_EQ(camera.open(), Status::kOk);
    FreenectCamera other({.calibration = "no-such-file.toml"});
    EXPECT_EQ(other.open(), Status::kInvalid);
    EXPECT_NE(other.message().find("no-such-file.toml"), std::string::npos);
}

// Promise: unplugged, it says so within a second, and can be opened again when it is back. A mere stall is no unplug.
TEST_F(FreenectCameraTest, UnplugAndReplug) {
    FreenectCamera camera;
    ASSERT_EQ(camera.open(), Status::kOk) << camera.message();
    Frame frame;
    for (int round = 0; round < 3; ++round) {
        ASSERT_EQ(next(camera, frame), Status::kOk);
        scripted_kinect.is_silent = true;
        // A pair on its way comes before the first call without one, however late it is.
        const int before = scripted_kinect.silences;
        while (scripted_kinect.silences == before) sleep_ms(1);
        while (camera.poll(frame) == Status::kOk) {
        }
        EXPECT_EQ(camera.wait(700), Status::kTimedOut) << "still plugged in";
        scripted_kinect.devices = 0;
        const Clock::time_point begin = Clock::now();
        EXPECT_EQ(camera.wait(3000), Status::kUnavailable);
        EXPECT_LT(seconds_since(begin), 1.0);
        EXPECT_EQ(camera.poll(frame), Status::kUnavailable);
        EXPECT_EQ(camera.open(), Status::kUnavailable);
        scripted_kinect.devices = 1;
        scripted_kinect.is_silent = false;
        ASSERT_EQ(camera.open(), Status::kOk) << camera.message();
    }
}

// Promise: a libfreenect that never comes back delays nobody longer than was agreed: not open, poll, wait or close.
TEST_F(FreenectCameraTest, HangsAreBounded) {
    FreenectCamera camera({.open_max_ms = 200});
    scripted_kinect.hangs = true;
    Clock::time_point begin = Clock::now();
    EXPECT_EQ(camera.open(), Status::kUnavailable);
    EXPECT_NE(camera.message().find("does not answer"), std::string::npos) << camera.message();
    EXPECT_LT(seconds_since(begin), 2.0);
    scripted_kinect.hangs = false;
    while (scripted_kinect.contexts > 0) sleep_ms(1);
    ASSERT_EQ(camera.open(), Status::kOk) << camera.message();
    Frame frame;
    ASSERT_EQ(next(camera, frame), Status::kOk);
    scripted_kinect.hangs = true;
    while (scripted_kinect.hanging == 0) sleep_ms(1);
    begin = Clock::now();
    static_cast<void>(camera.poll(frame));  // what came before
    EXPECT_EQ(camera.poll(frame), Status::kTimedOut);
    EXPECT_EQ(camera.wait(100), Status::kTimedOut);
    camera.close();
    EXPECT_LT(seconds_since(begin), 2.0);
}

}  // namespace
}  // namespace stillmesh::freenect_camera_test
