// What wheels, a gyroscope and an accelerometer say over ROS 2, with Fast DDS as the robot.
#include "platform/ros2/ros_motion.hpp"

#include <gtest/gtest.h>

#include <cmath>
#include <limits>
#include <string>
#include <vector>

#include "platform/poses/body_frames.hpp"
#include "tests/ros2/fast_dds.hpp"
#include "tests/ros2/ros_domain.hpp"
#include "tests/support/program.hpp"

namespace stillmesh::motion_test {
namespace {

using test::within;
namespace fast = test::fast;

constexpr std::int64_t kBegin_ns = 1'700'000'000'000'000'000, kPeriod_ns = 20'000'000;
constexpr std::int64_t kPatience_ms = 30'000;
constexpr int kAgo = 50;  // samples that may be on their way
constexpr double kTurn_rad_s = 0.7, kSpeed_m_s = 0.5;
// A camera that looks to the left, 20 cm ahead.
const RigidTransform kMount{{0, 0, std::sqrt(0.5), std::sqrt(0.5)}, {0.2, 0, 0.3}};

[[nodiscard]] fast::Header header_of(int i, const char* frame) {
    const std::int64_t time_ns = kBegin_ns + i * kPeriod_ns;
    return {static_cast<std::int32_t>(time_ns / 1'000'000'000), static_cast<std::uint32_t>(time_ns % 1'000'000'000),
            frame};
}
// base_link on a circle.
[[nodiscard]] RigidTransform base_at(int i) {
    const double angle = kTurn_rad_s * i * static_cast<double>(kPeriod_ns) * 1e-9, radius = kSpeed_m_s / kTurn_rad_s;
    return {{0, 0, std::sin(angle / 2), std::cos(angle / 2)},
            {radius * std::sin(angle), radius * (1 - std::cos(angle)), 0}};
}
[[nodiscard]] fast::Odometry odometry_of(int i) {
    const RigidTransform base = base_at(i);
    fast::Odometry out;
    out.header = header_of(i, "odom");
    out.child_frame_id = "base_link";
    for (std::size_t k = 0; k < 3; ++k) out.pose.p[k] = base.translation_m[k];
    for (std::size_t k = 0; k < 4; ++k) out.pose.q[k] = 2 * base.rotation_xyzw[k];  // of any length
    return out;
}
[[nodiscard]] fast::Imu rate_of(int i, const char* frame, const std::array<double, 3>& rad_s) {
    fast::Imu out;
    out.header = header_of(i, frame);
    out.angular_velocity = rad_s;
    return out;
}
// Of the camera, between two samples.
[[nodiscard]] RigidTransform step_of(int from, int to) {
    const RigidTransform b = compose(kMount, kLinkFromOptical);
    return compose(inverse_of(compose(base_at(from), b)), compose(base_at(to), b));
}
void expect_turn(const MotionHint& hint, const RigidTransform& expected) {
    double dot = 0;
    for (std::size_t k = 0; k < 4; ++k) dot += hint.last_from_camera.rotation_xyzw[k] * expected.rotation_xyzw[k];
    EXPECT_NEAR(std::abs(dot), 1, 1e-9);
}

// Promise: wheels say how the camera moved between two frames, wherever it is mounted; what they have not reached, what
// is no number and what is late is no hint, and of a long run the last seconds are kept.
TEST(RosMotion, WheelsAreTheMotionOfTheCamera) {
    RosMotion motion;
    std::string message;
    ASSERT_TRUE(motion.open(
        {.odometry = "/odom_in", .imu = "", .accelerometer = "", .errors = {}, .base_from_camera_link = kMount},
        message))
        << message;
    EXPECT_EQ(motion.sources(), "ROS 2's /odom_in");
    fast::Node node;
    fast::Node::Writer<fast::Odometry> wheels(node, "/odom_in", {.depth = 100});
    ASSERT_TRUE(within(kPatience_ms, [&] { return wheels.is_matched(); }));
    const auto time = [](int i) { return kBegin_ns + i * kPeriod_ns; };
    int sent = 0;
    // Matched on one side, not yet on the other: until something is heard, what was sent some turns ago.
    ASSERT_TRUE(within(kPatience_ms, [&] {
        EXPECT_TRUE(wheels.write(odometry_of(sent++)));
        return motion.between_times(time(sent - kAgo - 1), time(sent - kAgo)).has_value();
    }));
    fast::Odometry wrong = odometry_of(sent);
    wrong.pose.p[1] = std::numeric_limits<double>::quiet_NaN();
    EXPECT_TRUE(wheels.write(wrong) && wheels.write(odometry_of(sent - 1)));
    const int first = sent;
    for (; sent < first + 8; ++sent) EXPECT_TRUE(wheels.write(odometry_of(sent)));
    ASSERT_TRUE(within(kPatience_ms, [&] { return motion.between_times(time(first), time(sent - 1)).has_value(); }));
    for (int i = first; i + 2 < sent; ++i) {
        const auto hint = motion.between_times(time(i), time(i + 2));
        ASSERT_TRUE(hint.has_value());
        const RigidTransform expected = step_of(i, i + 2);
        for (std::size_t k = 0; k < 3; ++k)
            EXPECT_NEAR(hint->last_from_camera.translation_m[k], expected.translation_m[k], 5e-5);
        expect_turn(*hint, expected);
        EXPECT_GT(hint->sigma_m, 0);
        EXPECT_GT(hint->sigma_rad, 0);
    }
    EXPECT_FALSE(motion.between_times(time(first), time(sent)).has_value());
    EXPECT_FALSE(motion.between_times(time(-5), time(first)).has_value());
}

// Promise: a gyroscope says how the camera turned, in base_link's axes or in the camera's own, and nothing of the way.
TEST(RosMotion, AGyroscopeIsTheTurnOfTheCamera) {
    const RigidTransform back = inverse_of(compose(kMount, kLinkFromOptical));
    const std::array<double, 3> in_base{0, 0, kTurn_rad_s}, in_camera = rotated(back, in_base);
    for (const bool is_optical : {false, true}) {
        RosMotion motion;
        std::string message;
        ASSERT_TRUE(motion.open(
            {.odometry = "", .imu = "/imu", .accelerometer = "", .errors = {}, .base_from_camera_link = kMount},
            message))
            << message;
        fast::Node node;
        fast::Node::Writer<fast::Imu> gyroscope(node, "/imu", {.is_reliable = false, .depth = 100});
        ASSERT_TRUE(within(kPatience_ms, [&] { return gyroscope.is_matched(); }));
        int sent = 0;
        ASSERT_TRUE(within(kPatience_ms, [&] {
            const char* const frame = is_optical ? "camera_imu_optical_frame" : "base_link";
            EXPECT_TRUE(gyroscope.write(rate_of(sent++, frame, is_optical ? in_camera : in_base)));
            const int heard = sent - kAgo;
            const auto hint =
                motion.between_times(kBegin_ns + (heard - 1) * kPeriod_ns, kBegin_ns + heard * kPeriod_ns);
            if (!hint) return false;
            expect_turn(*hint, step_of(heard - 1, heard));
            EXPECT_LT(hint->sigma_m, 0);
            EXPECT_GT(hint->sigma_rad, 0);
            return true;
        }));
    }
}

// Promise: an accelerometer's readings are heard in the camera's axes, told in those of base_link or in the camera's
// own; those between two moments are given, without what is no number and what is late, and from them follows where up
// is.
TEST(RosMotion, AnAccelerometerSaysWhereUpIs) {
    const RigidTransform back = inverse_of(compose(kMount, kLinkFromOptical));
    const std::array<double, 3> in_base{0, 0, 9.81}, in_camera = rotated(back, in_base);
    for (const bool is_optical : {false, true}) {
        RosMotion motion;
        std::string message;
        ASSERT_TRUE(motion.open(
            {.odometry = "", .imu = "", .accelerometer = "/imu", .errors = {}, .base_from_camera_link = kMount},
            message))
            << message;
        EXPECT_EQ(motion.sources(), "ROS 2's /imu");
        fast::Node node;
        fast::Node::Writer<fast::Imu> imu(node, "/imu", {.is_reliable = false, .depth = 100});
        ASSERT_TRUE(within(kPatience_ms, [&] { return imu.is_matched(); }));
        const auto time = [](int i) { return kBegin_ns + i * kPeriod_ns; };
        const auto send = [&](int i, const std::array<double, 3>& m_s2) {
            fast::Imu out;
            out.header = header_of(i, is_optical ? "camera_imu_optical_frame" : "base_link");
            out.angular_velocity.fill(std::numeric_limits<double>::quiet_NaN());  // it has no gyroscope
            out.linear_acceleration = m_s2;
            EXPECT_TRUE(imu.write(out));
        };
        std::vector<Acceleration> heard;
        GravityFinder finder;
        finder.begin(&motion);
        int sent = 0;
        ASSERT_TRUE(within(kPatience_ms, [&] {
            send(sent, is_optical ? in_camera : in_base);
            send(sent, {std::numeric_limits<double>::quiet_NaN(), 0, 0});
            send(sent - 1, {1, 2, 3});
            TrajectoryPose pose;  // the camera stands still
            pose.time_ns = time(++sent - kAgo);
            finder.add(pose, {0, 0, 0, 1});
            motion.between(time(sent - kAgo - 3), time(sent - kAgo), heard);
            return finder.gravity().is_known && heard.size() == 3;
        })) << finder.gravity().why_not;
        for (std::size_t i = 0; i < 3; ++i) {
            EXPECT_EQ(heard[i].time_ns, time(sent - kAgo - 2 + static_cast<int>(i)));
            for (std::size_t k = 0; k < 3; ++k) EXPECT_NEAR(heard[i].m_s2[k], in_camera[k], 1e-9);
        }
        for (std::size_t k = 0; k < 3; ++k) EXPECT_NEAR(finder.gravity().up[k], in_camera[k] / 9.81, 1e-9);
        EXPECT_FALSE(motion.between_times(time(0), time(sent - kAgo)).has_value());
    }
}

// Promise: the words that ask for it are known, with the topic's name as ROS has it.
TEST(RosMotion, TopicsAreRead) {
    EXPECT_EQ(ros_motion_topic("ros2", "/odom_in"), "/odom_in");
    EXPECT_EQ(ros_motion_topic("ros2:/wheel/odom", "/odom_in"), "/wheel/odom");
    EXPECT_EQ(ros_motion_topic("ros2:wheel", "/odom_in"), "/wheel");
    for (const char* const other : {"", "none", "odometry.txt", "ros2.txt", "ros2:"})
        EXPECT_EQ(ros_motion_topic(other, "/odom_in"), "") << other;
}

}  // namespace
}  // namespace stillmesh::motion_test
