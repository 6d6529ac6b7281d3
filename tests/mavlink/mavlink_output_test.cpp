// What goes to an autopilot, read by a decoder of the test's own, its numbers against 4x4 matrices and differences.
#include "platform/mavlink/mavlink_output.hpp"

#include <gtest/gtest.h>

#include <cmath>
#include <random>

#include "engine/geometry/se3.hpp"
#include "tests/mavlink/mavlink_reader.hpp"
#include "tests/mavlink/udp_reader.hpp"
#include "tests/support/heap_calls.hpp"

namespace stillmesh::mavlink_output_test {
namespace {

using test::MavlinkRead;
using test::read_mavlink;

[[nodiscard]] MavlinkRead decoded(std::string_view bytes) {
    std::string why;
    const auto message = read_mavlink(bytes, why);
    EXPECT_TRUE(message.has_value()) << why;
    return message.value_or(MavlinkRead{});
}

[[nodiscard]] Eigen::Matrix4d matrix(const RigidTransform& pose) {
    const auto& [x, y, z, w] = pose.rotation_xyzw;
    Eigen::Matrix4d out = Eigen::Matrix4d::Identity();
    out.block<3, 3>(0, 0) = Eigen::Quaterniond(w, x, y, z).toRotationMatrix();
    for (int i = 0; i < 3; ++i) out(i, 3) = pose.translation_m[i];
    return out;
}

class Chance {
public:
    explicit Chance(unsigned seed) : random_(seed) {}
    [[nodiscard]] double number(double size) { return std::uniform_real_distribution<double>(-size, size)(random_); }
    [[nodiscard]] RigidTransform pose(double way_m, double turn_rad) {
        const Eigen::Vector3d axis(number(1), number(1), number(1));
        const Eigen::Quaterniond q(Eigen::AngleAxisd(number(turn_rad), axis.normalized()));
        return {{q.x(), q.y(), q.z(), q.w()}, {number(way_m), number(way_m), number(way_m)}};
    }
    [[nodiscard]] Matrix6 covariance(double (&out)[36]) {
        Matrix6 half;
        for (int i = 0; i < 36; ++i) half(i / 6, i % 6) = number(0.1);
        const Matrix6 whole = half * half.transpose();
        for (int i = 0; i < 36; ++i) out[i] = whole(i / 6, i % 6);
        return whole;
    }

private:
    std::mt19937 random_;
};

// The body (x forward, y right, z down) from the optical frame of a camera that is mounted so.
[[nodiscard]] Eigen::Matrix4d frd_from_optical(const RigidTransform& base_from_camera_link) {
    const Eigen::Matrix4d frd_from_flu = Eigen::Vector4d(1, -1, -1, 1).asDiagonal();
    Eigen::Matrix4d link_from_optical = Eigen::Matrix4d::Zero();
    link_from_optical(0, 2) = link_from_optical(3, 3) = 1;
    link_from_optical(1, 0) = link_from_optical(2, 1) = -1;
    return frd_from_flu * matrix(base_from_camera_link) * link_from_optical;
}

[[nodiscard]] PoseReport report_of(int frame, const RigidTransform& odom_from_camera, PoseState state) {
    PoseReport report;
    report.frame = static_cast<std::uint64_t>(frame);
    report.state = state;
    report.estimate.time_ns = 5'000'000'000 + std::int64_t{frame} * 10'000'000;
    report.estimate.odom_from_camera = odom_from_camera;
    for (int i = 0; i < 6; ++i) report.estimate.covariance[7 * i] = 1e-6;
    return report;
}

// Promise: a message is what the definitions say, with the seeds that follow from their fields; every number comes back
// to the bit; zeros at the end are left out and come back as zeros.
TEST(MavlinkMessages, AreAsDefined) {
    EXPECT_EQ(test::mavlink_seed(test::mavlink_definitions().at(0)), 50);
    EXPECT_EQ(test::mavlink_seed(test::mavlink_definitions().at(102)), 158);
    EXPECT_EQ(test::mavlink_seed(test::mavlink_definitions().at(331)), 91);
    Chance chance(1);
    MavlinkMessages messages(7);
    for (int i = 0; i < 300; ++i) {
        const bool ends_in_zeros = i % 3 == 0;
        const auto fill = [&chance](auto& numbers) {
            for (float& x : numbers) x = static_cast<float>(chance.number(100));
        };
        MavlinkOdometry out;
        out.time_us = 1'700'000'000'123'456U + static_cast<std::uint64_t>(i);
        fill(out.position_m), fill(out.rotation_wxyz), fill(out.velocity_m_s), fill(out.turn_rad_s);
        fill(out.pose_covariance), fill(out.velocity_covariance);
        out.reset_counter = static_cast<std::uint8_t>(i);
        out.quality_percent = ends_in_zeros ? std::int8_t{0} : static_cast<std::int8_t>(-1);
        const MavlinkRead read = decoded(messages.odometry(out));
        ASSERT_EQ(read.number, 331U);
        EXPECT_EQ(read.sequence, static_cast<std::uint8_t>(2 * i));
        EXPECT_EQ(read.system, 7);
        EXPECT_EQ(read.component, 197);
        EXPECT_EQ(read.at("time_usec"), static_cast<double>(out.time_us));
        EXPECT_EQ(read.at("frame_id"), 20);
        EXPECT_EQ(read.at("child_frame_id"), 12);
        EXPECT_EQ(read.at("y"), out.position_m[1]);
        for (std::size_t k = 0; k < 4; ++k) EXPECT_EQ(read.at("q", k), out.rotation_wxyz[k]);
        EXPECT_EQ(read.at("vz"), out.velocity_m_s[2]);
        EXPECT_EQ(read.at("yawspeed"), out.turn_rad_s[2]);
        for (std::size_t k = 0; k < 21; ++k) {
            EXPECT_EQ(read.at("pose_covariance", k), out.pose_covariance[k]);
            EXPECT_EQ(read.at("velocity_covariance", k), out.velocity_covariance[k]);
        }
        EXPECT_EQ(read.at("reset_counter"), out.reset_counter);
        EXPECT_EQ(read.at("estimator_type"), 2);
        EXPECT_EQ(read.at("quality"), out.quality_percent);

        MavlinkVision vision;
        vision.time_us = out.time_us;
        fill(vision.position_m), fill(vision.roll_pitch_yaw_rad);
        if (!ends_in_zeros) fill(vision.covariance);
        vision.reset_counter = ends_in_zeros ? std::uint8_t{0} : out.reset_counter;
        const MavlinkRead seen = decoded(messages.vision(vision));
        EXPECT_EQ(seen.at("z"), vision.position_m[2]);
        EXPECT_EQ(seen.at("roll"), vision.roll_pitch_yaw_rad[0]);
        EXPECT_EQ(seen.at("yaw"), vision.roll_pitch_yaw_rad[2]);
        for (std::size_t k = 0; k < 21; ++k) EXPECT_EQ(seen.at("covariance", k), vision.covariance[k]);
        EXPECT_EQ(seen.at("reset_counter"), vision.reset_counter);
    }
    const MavlinkRead beat = decoded(messages.heartbeat());
    EXPECT_EQ(beat.at("type"), 18);
    EXPECT_EQ(beat.at("autopilot"), 8);
    EXPECT_EQ(beat.at("system_status"), 4);
    EXPECT_EQ(beat.at("mavlink_version"), 3);
}

// Promise: whoever goes forward, right or down has x, y or z grow, with speeds of the same signs; who turns to the
// right or looks up has yaw or pitch grow.
TEST(MavlinkPoses, AxesAreForwardRightDown) {
    MavlinkPoses poses{RigidTransform{}};
    const RigidTransform before;
    ASSERT_FALSE(poses.frame(report_of(0, before, PoseState::kTracked)));  // no velocity yet
    const double s = std::sin(0.05), c = std::cos(0.05);
    // The optical frame: x right, y down, z forward. Turning to the right is about y, looking up about x.
    const RigidTransform moved{{0, s, 0, c}, {0.1, 0.2, 0.4}};
    ASSERT_TRUE(poses.frame(report_of(1, moved, PoseState::kTracked)));
    const MavlinkOdometry& out = poses.odometry();
    EXPECT_NEAR(out.position_m[0], 0.4, 1e-6);
    EXPECT_NEAR(out.position_m[1], 0.1, 1e-6);
    EXPECT_NEAR(out.position_m[2], 0.2, 1e-6);
    EXPECT_GT(out.velocity_m_s[0], 30);
    EXPECT_GT(out.velocity_m_s[2], 15);
    EXPECT_NEAR(out.turn_rad_s[2], 10, 1e-4);
    EXPECT_NEAR(poses.vision().roll_pitch_yaw_rad[2], 0.1, 1e-6);
    ASSERT_TRUE(poses.frame(report_of(2, {{s, 0, 0, c}, {0, 0, 0}}, PoseState::kTracked)));
    EXPECT_NEAR(poses.vision().roll_pitch_yaw_rad[1], 0.1, 1e-6);
    EXPECT_NEAR(poses.vision().roll_pitch_yaw_rad[2], 0, 1e-6);
}

// Promise: poses, covariances and speeds are those of matrices: B T B^-1, and J C J^T with J by differences, the
// positions in the local frame's axes and the rotations about the body's; roll, pitch and yaw make the same rotation.
TEST(MavlinkPoses, AsMatricesGive) {
    for (unsigned seed = 1; seed <= 20; ++seed) {
        Chance chance(seed);
        const RigidTransform mount = chance.pose(2, 3), first = chance.pose(2, 3), map_from_odom = chance.pose(2, 3);
        const RigidTransform next = compose(first, chance.pose(0.002, 0.002));
        const Eigen::Matrix4d b = frd_from_optical(mount), back = b.inverse();
        MavlinkPoses poses(mount);
        PoseReport report = report_of(0, first, PoseState::kTracked);
        report.estimate.map_from_odom = map_from_odom;
        const Matrix6 c0 = chance.covariance(report.estimate.covariance);
        ASSERT_FALSE(poses.frame(report));
        report = report_of(1, next, PoseState::kTracked);
        report.estimate.map_from_odom = map_from_odom;
        const Matrix6 c1 = chance.covariance(report.estimate.covariance);
        ASSERT_TRUE(poses.frame(report));

        const MavlinkOdometry& out = poses.odometry();
        const Eigen::Matrix4d in_map = matrix(map_from_odom) * matrix(next);
        const Eigen::Matrix4d body = b * in_map * back;
        for (int i = 0; i < 3; ++i) EXPECT_NEAR(out.position_m[static_cast<std::size_t>(i)], body(i, 3), 1e-5);
        const auto& [w, x, y, z] = out.rotation_wxyz;
        const Eigen::Matrix3d turned = Eigen::Quaterniond(w, x, y, z).toRotationMatrix();
        EXPECT_LT((turned - body.block<3, 3>(0, 0)).cwiseAbs().maxCoeff(), 1e-5);
        const auto& [roll, pitch, yaw] = poses.vision().roll_pitch_yaw_rad;
        const Eigen::Matrix3d by_angles =
            (Eigen::AngleAxisd(yaw, Eigen::Vector3d::UnitZ()) * Eigen::AngleAxisd(pitch, Eigen::Vector3d::UnitY()) *
             Eigen::AngleAxisd(roll, Eigen::Vector3d::UnitX()))
                .toRotationMatrix();
        EXPECT_LT((by_angles - turned).cwiseAbs().maxCoeff(), 1e-4);

        Matrix6 of_pose, of_body;
        for (int i = 0; i < 6; ++i) {
            constexpr double kStep = 1e-5;
            Eigen::Matrix4d moved = Eigen::Matrix4d::Identity();
            if (i < 3)
                moved(i, 3) = kStep;
            else
                moved.block<3, 3>(0, 0) = Eigen::AngleAxisd(kStep, Eigen::Vector3d::Unit(i - 3)).toRotationMatrix();
            const Eigen::Matrix4d after = b * in_map * moved * back, step = body.inverse() * after;
            const Eigen::AngleAxisd turn(Eigen::Matrix3d(step.block<3, 3>(0, 0)));
            of_pose.col(i).head<3>() = (after - body).block<3, 1>(0, 3) / kStep;
            of_body.col(i).head<3>() = step.block<3, 1>(0, 3) / kStep;
            of_pose.col(i).tail<3>() = of_body.col(i).tail<3>() = turn.angle() * turn.axis() / kStep;
        }
        const Matrix6 pose_covariance = of_pose * c1 * of_pose.transpose();
        const Matrix6 speed_covariance = of_body * (c0 + c1) * of_body.transpose() / (0.01 * 0.01);
        for (int i = 0, at = 0; i < 6; ++i) {
            for (int j = i; j < 6; ++j, ++at) {
                const auto k = static_cast<std::size_t>(at);
                EXPECT_NEAR(out.pose_covariance[k], pose_covariance(i, j), 1e-4) << seed << " " << i << " " << j;
                EXPECT_NEAR(out.velocity_covariance[k], speed_covariance(i, j), 1e-3 * speed_covariance.maxCoeff());
                EXPECT_EQ(poses.vision().covariance[k], out.pose_covariance[k]);
            }
        }
        const Eigen::Matrix4d step = (b * matrix(first) * back).inverse() * (b * matrix(next) * back);
        for (int i = 0; i < 3; ++i)
            EXPECT_NEAR(out.velocity_m_s[static_cast<std::size_t>(i)], step(i, 3) / 0.01, 0.02) << seed;
    }
}

// Promise: a worse state has a lower quality and a larger covariance; without a pose nothing is sent, nor of the frame
// behind it; the reset counter grows where the map's pose jumps, once each, and nowhere else.
TEST(MavlinkPoses, StatesAndJumps) {
    MavlinkPoses poses{RigidTransform{}};
    const RigidTransform still;
    int frame = 0;
    const auto next = [&](PoseState state, const RigidTransform& map_from_odom = {}, std::size_t map = 1) {
        PoseReport report = report_of(frame++, still, state);
        report.estimate.map_from_odom = map_from_odom;
        report.map = map;
        return poses.frame(report);
    };
    EXPECT_FALSE(next(PoseState::kTracked));
    EXPECT_TRUE(next(PoseState::kTracked));
    EXPECT_EQ(poses.odometry().quality_percent, 100);
    const float tracked = poses.odometry().pose_covariance[0];
    EXPECT_TRUE(next(PoseState::kUnsure));
    EXPECT_EQ(poses.odometry().quality_percent, 30);
    EXPECT_NEAR(poses.odometry().pose_covariance[0], tracked + 0.01, 1e-6);
    EXPECT_TRUE(next(PoseState::kPredicted));
    EXPECT_EQ(poses.odometry().quality_percent, 10);
    EXPECT_GT(poses.odometry().pose_covariance[0], 0.0101F);
    EXPECT_FALSE(next(PoseState::kNone));
    EXPECT_FALSE(next(PoseState::kTracked));
    EXPECT_TRUE(next(PoseState::kTracked));
    EXPECT_EQ(poses.odometry().reset_counter, 0);
    const RigidTransform corrected{{0, 0, 0, 1}, {0, 0, 0.03}};
    EXPECT_TRUE(next(PoseState::kTracked, corrected));
    EXPECT_EQ(poses.odometry().reset_counter, 1);
    EXPECT_NEAR(poses.odometry().position_m[0], 0.03, 1e-6);
    EXPECT_TRUE(next(PoseState::kTracked, corrected));
    EXPECT_EQ(poses.odometry().reset_counter, 1);
    EXPECT_FALSE(next(PoseState::kNone, corrected));  // found again elsewhere, behind a gap
    EXPECT_FALSE(next(PoseState::kTracked));
    EXPECT_TRUE(next(PoseState::kTracked));
    EXPECT_EQ(poses.odometry().reset_counter, 2);
    EXPECT_EQ(poses.vision().reset_counter, 2);
    EXPECT_FALSE(next(PoseState::kTracked, {}, 2));  // another map
    EXPECT_TRUE(next(PoseState::kTracked, {}, 2));
    EXPECT_EQ(poses.odometry().reset_counter, 3);
}

// Promise: a message a frame and a heartbeat a second come out of the socket, in order, without a heap call.
TEST(MavlinkOutput, SendsAFrameAndAHeartbeatASecond) {
    ASSERT_TRUE(test::heap_calls_are_counted());
    for (const MavlinkMessage kind : {MavlinkMessage::kOdometry, MavlinkMessage::kVision}) {
        const test::UdpReader reader;
        MavlinkOutput output;
        std::string message;
        ASSERT_TRUE(output.open({.destination = reader.destination(), .message = kind, .system = 3}, message))
            << message;
        constexpr int kFrames = 250;  // of 10 ms
        const std::uint64_t calls = test::heap_calls();
        for (int i = 0; i < kFrames; ++i) {
            const std::string said = output.frame(report_of(i, {}, PoseState::kTracked));
            ASSERT_TRUE(said.empty()) << said;
        }
        EXPECT_EQ(test::heap_calls(), calls);
        EXPECT_EQ(output.problem(), "");
        int heartbeats = 0, poses = 0, expected = 0;
        for (const std::string& datagram : reader.datagrams()) {
            const MavlinkRead read = decoded(datagram);
            EXPECT_EQ(read.sequence, static_cast<std::uint8_t>(expected++));
            EXPECT_EQ(read.system, 3);
            heartbeats += read.number == 0 ? 1 : 0;
            poses += read.number == (kind == MavlinkMessage::kVision ? 102U : 331U) ? 1 : 0;
        }
        EXPECT_EQ(heartbeats, 3);  // at 0, 1 and 2 s
        EXPECT_EQ(poses, kFrames - 1);
    }
}

// Promise: where nobody listens it is said once and counted, and sending goes on when somebody comes; what is no
// destination is refused with a sentence.
TEST(MavlinkOutput, LosesAndSaysSo) {
    test::UdpReader reader;
    MavlinkOutput output;
    std::string message;
    ASSERT_TRUE(output.open({.destination = reader.destination()}, message)) << message;
    reader.close();
    int said = 0;
    for (int i = 0; i < 50; ++i) {
        const std::string sentence = output.frame(report_of(i, {}, PoseState::kTracked));
        if (sentence.empty()) continue;
        ++said;
        EXPECT_NE(sentence.find("--mavlink udp:127.0.0.1:"), std::string::npos) << sentence;
        EXPECT_NE(sentence.find("nobody listens there; the run goes on without these messages."), std::string::npos);
    }
    EXPECT_EQ(said, 1);
    EXPECT_NE(output.problem().find(" messages were lost."), std::string::npos) << output.problem();
    for (const char* const wrong :
         {"tcp:127.0.0.1:14550", "14550", "udp:127.0.0.1:", "udp:127.0.0.1:99999", "/dev/ttyS0"}) {
        MavlinkOutput refused;
        message.clear();
        EXPECT_FALSE(refused.open({.destination = wrong}, message)) << wrong;
        EXPECT_EQ(message.rfind("--mavlink " + std::string(wrong) + ": ", 0), 0U) << message;
        EXPECT_EQ(message.back(), '.') << message;
    }
}

}  // namespace
}  // namespace stillmesh::mavlink_output_test
