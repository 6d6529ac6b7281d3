#include "bench/accuracy/measures.hpp"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>

#include "engine/base/check.hpp"
#include "engine/base/random.hpp"
// After CHECK: Eigen's assertions are ours.
#include <Eigen/Dense>

namespace stillmesh::accuracy::measures_test {
namespace {

constexpr std::int64_t kFrame_ns = 33'333'333;
constexpr double kDegree = 3.14159265358979323846 / 180;

TrajectoryPose turned(double angle_rad, std::array<double, 3> t) {
    TrajectoryPose pose;
    pose.t = t;
    pose.q = {0, 0, std::sin(angle_rad / 2), std::cos(angle_rad / 2)};
    return pose;
}

// A camera that sways and turns about z; `count` frames, tracked without error.
std::vector<FrameRecord> perfect_run(std::size_t count) {
    std::vector<FrameRecord> frames(count);
    for (std::size_t i = 0; i < count; ++i) {
        const double s = static_cast<double>(i) * 0.05;
        FrameRecord& frame = frames[i];
        frame.time_ns = 1'000'000'000 + static_cast<std::int64_t>(i) * kFrame_ns;
        frame.state = PoseState::kTracked;
        frame.has_truth = true;
        frame.truth = turned(0.3 * std::sin(s), {std::sin(s), 0.5 * std::cos(1.3 * s), 0.2 * std::sin(0.7 * s)});
        frame.truth.time_ns = frame.time_ns;
        frame.estimate = frame.truth;
        for (std::size_t k = 0; k < 6; ++k) frame.covariance[k * 7] = k < 3 ? 1e-4 : 4e-6;
    }
    return frames;
}

// Promise: a perfect path has no error, every judged frame is right, and its NEES is nothing.
TEST(Measures, PerfectRun) {
    const Measures m = measure(perfect_run(90));
    EXPECT_EQ(m.frames, 90U);
    EXPECT_EQ(m.tracked, 90U);
    EXPECT_DOUBLE_EQ(m.coverage(), 1.0);
    EXPECT_LT(m.ate_m, 1e-12);
    EXPECT_LT(m.rpe_m, 1e-12);
    EXPECT_EQ(m.judged_tracked, 62U);  // 28 frames have no pose within a tenth of a second of one second before
    EXPECT_EQ(m.right, 62U);
    EXPECT_EQ(m.right_tracked, 62U);
    EXPECT_EQ(m.wrong_tracked, 0U);
    EXPECT_EQ(m.nees_frames, 89U);
    EXPECT_LT(m.nees_first_sum, 1e-12);
    EXPECT_LT(m.nees_fit_sum, 1e-12);
    EXPECT_FALSE(m.is_lost());
}

// Promise: the truth may lie anywhere in the world: only motion counts.
TEST(Measures, WorldOfTheTruthDoesNotMatter) {
    std::vector<FrameRecord> frames = perfect_run(90);
    for (FrameRecord& frame : frames) {  // a quarter turn about z, and far away
        const auto [x, y, z] = frame.truth.t;
        frame.truth.t = {-y + 7, x - 3, z + 1};
        const auto [qx, qy, qz, qw] = frame.truth.q;
        const double h = std::sqrt(0.5);
        frame.truth.q = {h * qx - h * qy, h * qy + h * qx, h * qz + h * qw, h * qw - h * qz};
    }
    const Measures m = measure(frames);
    EXPECT_LT(m.ate_m, 1e-9);
    EXPECT_LT(m.nees_first_sum, 1e-9);
    EXPECT_LT(m.nees_fit_sum, 1e-9);
    EXPECT_LT(m.nees_ate_sum, 1e-9);
    EXPECT_EQ(m.wrong_tracked, 0U);
}

// The exponential by its power series, independent of any closed form.
Eigen::Matrix4d exponential(const Eigen::Matrix<double, 6, 1>& xi) {
    Eigen::Matrix4d twist = Eigen::Matrix4d::Zero();
    twist(0, 1) = -xi[5], twist(0, 2) = xi[4], twist(1, 2) = -xi[3];
    twist(1, 0) = xi[5], twist(2, 0) = -xi[4], twist(2, 1) = xi[3];
    twist.topRightCorner<3, 1>() = xi.head<3>();
    Eigen::Matrix4d sum = Eigen::Matrix4d::Identity();
    Eigen::Matrix4d term = Eigen::Matrix4d::Identity();
    for (int n = 1; n < 40; ++n) {
        const Eigen::Matrix4d next = term * twist / n;
        term = next;
        sum += term;
    }
    return sum;
}

Eigen::Matrix4d matrix(const TrajectoryPose& pose) {
    Eigen::Matrix4d out = Eigen::Matrix4d::Identity();
    out.topLeftCorner<3, 3>() = Eigen::Quaterniond(pose.q[3], pose.q[0], pose.q[1], pose.q[2]).toRotationMatrix();
    out.topRightCorner<3, 1>() = Eigen::Vector3d(pose.t[0], pose.t[1], pose.t[2]);
    return out;
}

// Promise: errors xi in estimate * exp(xi) = truth, drawn from the covariance that is told, have a mean NEES of 6 (3
// for translation and rotation alone), however large, lopsided and correlated they are.
TEST(Measures, HonestCovarianceHasNeesSix) {
    std::vector<FrameRecord> frames = perfect_run(10'000);
    Random random(7);
    const auto normal = [&random] {  // Box-Muller
        const double a = random.uniform() + 1e-18;
        return std::sqrt(-2 * std::log(a)) * std::cos(2 * 3.14159265358979323846 * random.uniform());
    };
    Eigen::Matrix<double, 6, 6, Eigen::RowMajor> lower;
    lower.setZero();
    for (int row = 0; row < 6; ++row) {
        for (int column = 0; column <= row; ++column) lower(row, column) = 0.05 * (row == column ? 1.0 + row : 0.5);
    }
    const Eigen::Matrix<double, 6, 6, Eigen::RowMajor> covariance = lower * lower.transpose();
    for (std::size_t i = 1; i < frames.size(); ++i) {
        FrameRecord& frame = frames[i];
        Eigen::Matrix<double, 6, 1> unit;
        for (int k = 0; k < 6; ++k) unit[k] = normal();
        const Eigen::Matrix<double, 6, 1> xi = lower * unit;
        const Eigen::Matrix4d truth = matrix(frame.estimate) * exponential(xi);
        const Eigen::Quaterniond q(Eigen::Matrix3d(truth.topLeftCorner<3, 3>()));
        frame.truth.t = {truth(0, 3), truth(1, 3), truth(2, 3)};
        frame.truth.q = {q.x(), q.y(), q.z(), q.w()};
        std::copy_n(covariance.data(), 36, frame.covariance.begin());
    }
    const Measures m = measure(frames);
    const auto n = static_cast<double>(m.nees_frames);
    EXPECT_EQ(m.nees_frames, 9'999U);
    EXPECT_NEAR(m.nees_first_sum / n, 6.0, 0.14);  // 4 sigma
    EXPECT_NEAR(m.nees_first_translation_sum / n, 3.0, 0.1);
    EXPECT_NEAR(m.nees_first_rotation_sum / n, 3.0, 0.1);
    EXPECT_NEAR(m.nees_fit_sum / n, 6.0, 0.2);
    EXPECT_NEAR(m.nees_fit_translation_sum / n, 3.0, 0.1);
    EXPECT_NEAR(m.nees_fit_rotation_sum / n, 3.0, 0.1);
    EXPECT_NEAR(m.said_m2_sum / n, (covariance.topLeftCorner<3, 3>().trace()), 1e-9);
}

// Promise: drift counts in full when the first pose is aligned, and only by its spread when all are.
TEST(Measures, DriftCountsFromTheFirstPose) {
    std::vector<FrameRecord> frames = perfect_run(101);
    for (std::size_t i = 0; i < frames.size(); ++i) frames[i].estimate.t[2] += 0.001 * static_cast<double>(i);
    const Measures m = measure(frames);
    // Sum of (i mm)^2 / (10 mm)^2 over 1..100, and of ((i - 50) mm)^2 / (10 mm)^2.
    EXPECT_NEAR(m.nees_first_sum, 338350.0 / 100, 1e-6);
    EXPECT_NEAR(m.nees_fit_sum, (85850.0 - 2500) / 100, 1e-6);
}

// Promise: a jump beyond 5 cm makes every tracked frame wrong for one second, and no longer; below it none.
TEST(Measures, JumpIsWrongForOneSecond) {
    for (const double jump_m : {0.049, 0.051}) {
        std::vector<FrameRecord> frames = perfect_run(120);
        for (std::size_t i = 60; i < frames.size(); ++i) frames[i].estimate.t[0] += jump_m;
        const Measures m = measure(frames);
        EXPECT_EQ(m.wrong_tracked, jump_m > 0.05 ? 30U : 0U);
        EXPECT_EQ(m.right, jump_m > 0.05 ? 62U : 92U);
        if (jump_m > 0.05) {
            EXPECT_EQ(m.wrong_first, 60U);
        }
    }
}

// Promise: a turn beyond 3 degrees is wrong, below it right.
TEST(Measures, TurnOfThreeDegrees) {
    for (const double turn_deg : {2.9, 3.1}) {
        std::vector<FrameRecord> frames = perfect_run(60);
        const double psi = 2 * std::atan2(frames[59].truth.q[2], frames[59].truth.q[3]) + turn_deg * kDegree;
        frames[59].estimate = turned(psi, frames[59].truth.t);
        frames[59].estimate.time_ns = frames[59].time_ns;
        EXPECT_EQ(measure(frames).wrong_tracked, turn_deg > 3 ? 1U : 0U);
    }
}

// Promise: a wrong frame that says unsure is no lie; a right one that says unsure is a lack of trust.
TEST(Measures, UnsureIsCountedForWhatItIs) {
    std::vector<FrameRecord> frames = perfect_run(60);
    frames[40].state = PoseState::kUnsure;
    frames[50].state = PoseState::kUnsure;
    frames[50].estimate.t[1] += 1;
    const Measures m = measure(frames);
    EXPECT_EQ(m.wrong_tracked, 0U);
    EXPECT_EQ(m.right, 31U);
    EXPECT_EQ(m.right_tracked, 30U);
    EXPECT_EQ(m.judged_unsure, 2U);
    EXPECT_EQ(m.wrong_unsure, 1U);
    EXPECT_DOUBLE_EQ(m.coverage(), 1.0);
}

// Promise: predicted poses are judged by themselves, and count neither as right nor as wrong elsewhere.
TEST(Measures, PredictedIsJudgedByItself) {
    std::vector<FrameRecord> frames = perfect_run(60);
    frames[40].state = frames[50].state = PoseState::kPredicted;
    frames[50].estimate.t[1] += 1;
    const Measures m = measure(frames);
    EXPECT_EQ(m.judged_predicted, 2U);
    EXPECT_EQ(m.wrong_predicted, 1U);
    EXPECT_EQ(m.judged_unsure + m.wrong_unsure + m.wrong_tracked, 0U);
    EXPECT_EQ(m.right, 30U);
}

// Promise: predicted frames and frames without a pose are not covered, whatever they say; a long hole is a lost run.
TEST(Measures, PredictedIsNotCovered) {
    std::vector<FrameRecord> frames = perfect_run(100);
    for (std::size_t i = 40; i < 70; ++i) {
        frames[i].state = i % 2 == 0 ? PoseState::kPredicted : PoseState::kNone;
        frames[i].estimate.t[0] += 5;
    }
    Measures m = measure(frames);
    EXPECT_DOUBLE_EQ(m.coverage(), 0.7);
    EXPECT_EQ(m.predicted, 15U);
    EXPECT_EQ(m.hole_longest, 30U);
    EXPECT_LT(m.ate_m, 1e-12);
    EXPECT_FALSE(m.is_lost());
    frames[70].state = PoseState::kPredicted;
    EXPECT_TRUE(measure(frames).is_lost());
    frames = perfect_run(100);
    frames[99].state = PoseState::kNone;
    EXPECT_TRUE(measure(frames).is_lost());
}

// Promise: a covariance that cannot be inverted is counted, not believed.
TEST(Measures, BadCovarianceIsCounted) {
    std::vector<FrameRecord> frames = perfect_run(10);
    frames[3].covariance = {};
    frames[4].covariance[0] = -1e-4;
    frames[5].covariance[7] = std::nan("");
    const Measures m = measure(frames);
    EXPECT_EQ(m.covariance_bad, 3U);
    EXPECT_EQ(m.nees_frames, 6U);
}

// Promise: a choice is wrong when more votes lie on moving pixels than not; shares are sums over the frames.
TEST(Measures, VotesOnMovingPixels) {
    std::vector<FrameRecord> frames = perfect_run(4);
    frames[0].has_mask = frames[1].has_mask = frames[2].has_mask = true;
    frames[0].moving = 10, frames[0].moving_accepted = 5, frames[0].still = 20, frames[0].still_accepted = 5;
    frames[1].moving = 30, frames[1].moving_accepted = 6, frames[1].still = 20, frames[1].still_accepted = 5;
    const Measures m = measure(frames);
    EXPECT_EQ(m.masked_frames, 3U);
    EXPECT_EQ(m.wrong_choices, 1U);
    EXPECT_EQ(m.moving, 40U);
    EXPECT_EQ(m.moving_accepted, 11U);
    EXPECT_EQ(m.still_accepted, 10U);
}

// Promise: between two true poses lies the pose half way, and beyond the ends or in a gap there is none.
TEST(Measures, TruthBetweenPoses) {
    Trajectory truth{turned(0.2, {0, 0, 0}), turned(0.4, {1, 2, 3})};
    truth[0].time_ns = 1000;
    truth[1].time_ns = 2000;
    for (double& q : truth[1].q) q = -q;  // the same rotation
    TrajectoryPose pose;
    ASSERT_TRUE(truth_at(truth, 1500, 1000, pose));
    EXPECT_NEAR(2 * std::atan2(pose.q[2], pose.q[3]), 0.3, 1e-9);
    EXPECT_NEAR(pose.t[2], 1.5, 1e-12);
    ASSERT_TRUE(truth_at(truth, 1000, 0, pose));
    EXPECT_EQ(pose.t[0], 0);
    EXPECT_FALSE(truth_at(truth, 1500, 999, pose));
    EXPECT_FALSE(truth_at(truth, 999, 1000, pose));
    EXPECT_FALSE(truth_at(truth, 2001, 1000, pose));
}

}  // namespace
}  // namespace stillmesh::accuracy::measures_test
