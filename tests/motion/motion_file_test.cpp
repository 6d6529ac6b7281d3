#include "platform/motion/motion_file.hpp"

#include <gtest/gtest.h>

#include <cmath>
#include <fstream>
#include <string>

#include "platform/motion/triple_lines.hpp"
#include "tests/support/temporary_folder.hpp"

namespace stillmesh::motion_file_test {
namespace {

constexpr std::int64_t kSecond_ns = 1'000'000'000;

class MotionFiles : public testing::Test {
protected:
    std::string file(const std::string& name, const std::string& text) {
        const std::string path = folder_.path(name);
        std::ofstream(path) << text;
        return path;
    }
    test::TemporaryFolder folder_;
    MotionFile motion_;
    std::string message_;
};

// Promise: between two poses of the odometry the camera moves evenly; the step is seen from the camera, and its
// deviation is the share of its own way.
TEST_F(MotionFiles, OdometryIsAStepSeenFromTheCamera) {
    // Turned by a quarter about z: the way along the world's y is along the camera's x.
    const std::string name = file("odometry.txt",
                                  "# comment\n"
                                  "10.0 0 0 0 0 0 0.70710678 0.70710678\n"
                                  "10.2 0 1 0 0 0 0.70710678 0.70710678\n");
    ASSERT_EQ(motion_.read_odometry(name, message_), Status::kOk) << message_;
    const auto hint = motion_.between_times(10 * kSecond_ns + 50'000'000, 10 * kSecond_ns + 150'000'000);
    ASSERT_TRUE(hint.has_value());
    EXPECT_NEAR(hint->last_from_camera.translation_m[0], 0.5, 1e-9);
    EXPECT_NEAR(hint->last_from_camera.translation_m[1], 0, 1e-9);
    EXPECT_NEAR(hint->last_from_camera.rotation_xyzw[3], 1, 1e-9);
    EXPECT_NEAR(hint->sigma_m, 0.02 * 0.5 + 0.0003, 1e-9);
    EXPECT_NEAR(hint->sigma_rad, 0.0003, 1e-9);
    EXPECT_EQ(motion_.sources(), name);
}

// Promise: a rate that stays gives its angle, wherever frames lie between the lines; of the odometry's rotation and the
// gyroscope's the surer one counts.
TEST_F(MotionFiles, AGyroscopeIsSummedUp) {
    const std::string text =
        "1.00 0 0.3 0\n"
        "1.01 0 0.3 0\n"
        "1.02 0 0.3 0\n"
        "1.20 0 0.3 0\n"
        "1.30 0 0.5 0\n";
    ASSERT_EQ(motion_.read_gyroscope(file("gyro.txt", text), message_), Status::kOk) << message_;
    const auto turn = [&](std::int64_t from_ms, std::int64_t to_ms) {
        const auto hint = motion_.between_times(from_ms * 1'000'000, to_ms * 1'000'000);
        if (!hint) return -1.0;
        EXPECT_LT(hint->sigma_m, 0);
        EXPECT_NEAR(hint->sigma_rad, (0.0087266463 + 0.00087) * 1e-3 * static_cast<double>(to_ms - from_ms), 1e-9);
        const double* const q = hint->last_from_camera.rotation_xyzw;
        return rotation_vector_of({q[0], q[1], q[2], q[3]})[1];
    };
    EXPECT_NEAR(turn(1000, 1010), 0.003, 1e-12);
    EXPECT_NEAR(turn(1003, 1177), 0.3 * 0.174, 1e-12);
    EXPECT_NEAR(turn(1200, 1300), 0.04, 1e-12);  // from .3 to .5
    EXPECT_NEAR(turn(1250, 1300), 0.45 * 0.05, 1e-12);
    EXPECT_EQ(turn(999, 1010), -1);
    EXPECT_EQ(turn(1200, 1301), -1);

    const std::string odometry = file("odometry.txt", "1.0 0 0 0 0 0 0 1\n1.2 0 0 0.1 0 0.5 0 0.8660254\n");
    ASSERT_EQ(motion_.read_odometry(odometry, message_), Status::kOk) << message_;
    EXPECT_NEAR(rotation_vector_of(Quaternion{0, 0.5, 0, 0.8660254})[1], 1.047, 1e-3);
    const auto both = motion_.between_times(1000 * 1'000'000, 1200 * 1'000'000);
    ASSERT_TRUE(both.has_value());
    EXPECT_NEAR(both->last_from_camera.translation_m[2], 0.1, 1e-9);
    EXPECT_GT(both->sigma_m, 0);
    EXPECT_NEAR(both->last_from_camera.rotation_xyzw[1], std::sin(0.03), 1e-9);  // .3 rad/s for .2 s
}

// Promise: before the first line, behind the last and in a hole there is no hint.
TEST_F(MotionFiles, WhatIsNotCoveredHasNoHint) {
    const std::string name =
        file("odometry.txt", "1.0 0 0 0 0 0 0 1\n1.1 0 0 0 0 0 0 1\n1.4 0 0 0 0 0 0 1\n1.5 0 0 0 0 0 0 1\n");
    ASSERT_EQ(motion_.read_odometry(name, message_), Status::kOk);
    const auto is_there = [&](std::int64_t from_ms, std::int64_t to_ms) {
        return motion_.between_times(from_ms * 1'000'000, to_ms * 1'000'000).has_value();
    };
    EXPECT_TRUE(is_there(1000, 1100));
    EXPECT_TRUE(is_there(1050, 1450));  // over the hole: both ends are known
    EXPECT_FALSE(is_there(950, 1050));
    EXPECT_FALSE(is_there(1450, 1550));
    EXPECT_FALSE(is_there(1150, 1450));  // begins in it
}

// Promise: a file that is not there, and every line that cannot be one, is refused with the file, the line and what a
// line is.
TEST_F(MotionFiles, BadLinesAreNamed) {
    const struct {
        const char* text;
        const char* says;
    } cases[] = {
        {"1.0 0 0 0\n1.0 0 0 0\n", "line 2: its time is not after"},
        {"1.0 0 0 0\n\n# c\n0.9 0 0 0\n", "line 4: its time is not after"},
        {"1.0 0 0\n", "line 1: 3 words"},
        {"1.0 0 0 0 0\n", "line 1: too many words"},
        {"now 0 0 0\n", "'now' is not a time"},
        {"-1 0 0 0\n", "'-1' is not a time"},
        {"1.0 0 x 0\n", "'x' is not a number"},
        {"1.0 0 nan 0\n", "'nan' is not a number"},
        {"1.0 0 1e999 0\n", "is not a number"},
        {"1.0 0 300 0\n", "are these degrees?"},
        {"1.0 0 0 0\n", "has 1 lines"},
        {"", "has 0 lines"},
    };
    for (const auto& [text, says] : cases) {
        message_.clear();
        EXPECT_EQ(motion_.parse_gyroscope(text, "gyro.txt", message_), Status::kInvalid) << text;
        EXPECT_NE(message_.find(says), std::string::npos) << message_;
        EXPECT_NE(message_.find("gyro.txt"), std::string::npos) << message_;
        EXPECT_NE(message_.find("timestamp wx wy wz"), std::string::npos) << message_;
    }
    EXPECT_EQ(motion_.read_odometry(file("odometry.txt", "1.0 0 0 0 0 0 0 1\n1.1 0 0\n"), message_), Status::kInvalid);
    EXPECT_NE(message_.find("odometry.txt, line 2"), std::string::npos) << message_;
    EXPECT_EQ(motion_.read_odometry(file("odometry.txt", "1.0 0 0 0 0 0 0 1\n"), message_), Status::kInvalid);
    EXPECT_NE(message_.find("a motion needs two"), std::string::npos) << message_;
    EXPECT_EQ(motion_.read_odometry(folder_.path("none.txt"), message_), Status::kUnavailable);
    EXPECT_EQ(motion_.read_gyroscope(folder_.path("none.txt"), message_), Status::kUnavailable);
    EXPECT_NE(message_.find("none.txt"), std::string::npos) << message_;
}

// Promise: poses farther apart than a camera gets between frames are no hint, and leave the frame as it is.
TEST_F(MotionFiles, ALeapIsNoHint) {
    const std::string name = file("odometry.txt", "1.0 0 0 0 0 0 0 1\n1.1 5000 0 0 0 0 0 1\n");
    ASSERT_EQ(motion_.read_odometry(name, message_), Status::kOk);
    EXPECT_FALSE(motion_.between_times(kSecond_ns, kSecond_ns + 100'000'000).has_value());
}

// Promise: a line of the gyroscope is read back as it was written.
TEST_F(MotionFiles, LinesComeBack) {
    const std::string text = triple_line(1'234'567'890, {0.25, -0.5, 1}) + triple_line(1'300'000'000, {0.25, -0.5, 1});
    ASSERT_EQ(motion_.parse_gyroscope(text, "gyro.txt", message_), Status::kOk) << message_;
    const auto hint = motion_.between_times(1'234'567'890, 1'300'000'000);
    ASSERT_TRUE(hint.has_value());
    const double* const q = hint->last_from_camera.rotation_xyzw;
    const Triple turn = rotation_vector_of({q[0], q[1], q[2], q[3]});
    const double seconds = (1'300'000'000 - 1'234'567'890) * 1e-9;
    EXPECT_NEAR(turn[0], 0.25 * seconds, 1e-9);
    EXPECT_NEAR(turn[1], -0.5 * seconds, 1e-9);
    EXPECT_NEAR(turn[2], seconds, 1e-9);
}

}  // namespace
}  // namespace stillmesh::motion_file_test
