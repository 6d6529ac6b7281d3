#include "platform/evaluation/evaluation.hpp"

#include <gtest/gtest.h>

#include <cmath>
#include <limits>

#include "tests/replay/recording_folder.hpp"

namespace stillmesh {
namespace {

[[nodiscard]] Trajectory load(const std::string& name) {
    Trajectory trajectory;
    std::string message;
    EXPECT_EQ(read_trajectory(std::string(STILLMESH_TEST_FILES) + "/" + name, trajectory, message), Status::kOk)
        << message;
    return trajectory;
}

// Promise: ATE and RPE are those of the TUM benchmark's definition: the constants come from an independent script
// (numpy) that follows evaluate_ate.py and evaluate_rpe.py, run over the two files in tests/platform/data.
TEST(Evaluation, EqualsTheTumTools) {
    const Trajectory truth = load("truth.txt");
    const Trajectory estimate = load("estimate.txt");
    const auto result = evaluate(truth, estimate);
    ASSERT_TRUE(result.has_value());
    EXPECT_EQ(result->pairs.size(), 109U);
    EXPECT_NEAR(result->ate_rmse_m, 0.05252695229659928, 1e-9);
    EXPECT_NEAR(result->ate_mean_m, 0.04869962903897162, 1e-9);
    EXPECT_NEAR(result->ate_median_m, 0.05354838022377318, 1e-9);
    EXPECT_NEAR(result->ate_max_m, 0.0793128165216592, 1e-9);
    EXPECT_EQ(result->rpe_pairs, 82U);
    EXPECT_NEAR(result->rpe_translation_rmse_m, 0.054902061729364696, 1e-9);
    EXPECT_NEAR(result->rpe_rotation_rmse_deg, 0.6810647343098745, 1e-7);

    // A window so narrow that most poses find no partner.
    const auto narrow = evaluate(truth, estimate, {.gap_max_ns = 2'000'000, .delta_ns = 500'000'000});
    ASSERT_TRUE(narrow.has_value());
    EXPECT_EQ(narrow->pairs.size(), 45U);
    EXPECT_NEAR(narrow->ate_rmse_m, 0.0501840855021916, 1e-9);
    EXPECT_EQ(narrow->rpe_pairs, 33U);
    EXPECT_NEAR(narrow->rpe_translation_rmse_m, 0.029764286683834636, 1e-9);
    EXPECT_NEAR(narrow->rpe_rotation_rmse_deg, 0.7685079696354975, 1e-7);
}

// Promise: a rigidly moved copy of the truth has no error, whatever the motion; a scaled one has (no scale is fitted).
TEST(Evaluation, RigidMotionIsNoErrorScaleIs) {
    const Trajectory truth = load("truth.txt");
    Trajectory moved = truth;
    // 90 degrees about z, then a shift: exact in every digit.
    const double half = std::sqrt(0.5);
    for (TrajectoryPose& pose : moved) {
        pose.t = {-pose.t[1] + 3, pose.t[0] - 2, pose.t[2] + 1};
        const auto [x, y, z, w] = pose.q;
        pose.q = {half * (x - y), half * (y + x), half * (z + w), half * (w - z)};
    }
    const auto result = evaluate(truth, moved);
    ASSERT_TRUE(result.has_value());
    EXPECT_LT(result->ate_max_m, 1e-9);
    EXPECT_LT(result->rpe_translation_rmse_m, 1e-9);
    EXPECT_LT(result->rpe_rotation_rmse_deg, 1e-5);
    EXPECT_NEAR(result->truth_from_estimate_r[1], 1.0, 1e-9);
    EXPECT_EQ(result->coverage, 1.0);

    Trajectory scaled = truth;
    for (TrajectoryPose& pose : scaled) {
        for (double& value : pose.t) value *= 1.1;
    }
    EXPECT_GT(evaluate(truth, scaled)->ate_rmse_m, 0.03);
}

// Promise: a mirrored trajectory is not aligned by a reflection, and all points on a line or in one place are no crash.
TEST(Evaluation, DegenerateShapes) {
    const Trajectory truth = load("truth.txt");
    Trajectory mirrored = truth;
    for (TrajectoryPose& pose : mirrored) pose.t[2] = -pose.t[2];
    EXPECT_GT(evaluate(truth, mirrored)->ate_rmse_m, 0.01);
    Trajectory still = truth;
    for (TrajectoryPose& pose : still) pose.t = {1, 2, 3};
    EXPECT_TRUE(std::isfinite(evaluate(truth, still)->ate_rmse_m));
    Trajectory line = truth;
    for (TrajectoryPose& pose : line) pose.t = {pose.t[0], 0, 0};
    EXPECT_LT(evaluate(line, line)->ate_rmse_m, 1e-9);
    EXPECT_FALSE(evaluate(truth, Trajectory(truth.begin(), truth.begin() + 2)).has_value());
    EXPECT_FALSE(evaluate(truth, {}).has_value());
    EXPECT_FALSE(evaluate({}, truth).has_value());
}

// Promise: coverage is the share of time with poses: half a trajectory covers half, a hole is missing, whole is 1.
TEST(Evaluation, CoverageCountsTime) {
    const Trajectory truth = load("truth.txt");
    EXPECT_NEAR(evaluate(truth, Trajectory(truth.begin(), truth.begin() + 200))->coverage, 0.5, 0.03);
    Trajectory hole(truth.begin(), truth.begin() + 100);
    hole.insert(hole.end(), truth.begin() + 300, truth.end());
    EXPECT_NEAR(evaluate(truth, hole)->coverage, 0.5, 0.03);
    EXPECT_NEAR(evaluate(truth, load("estimate.txt"))->coverage, 0.9, 0.05);
}

// Promise: what we write reads back: times exactly, numbers to 1e-9; and unsorted files, commas and NaN lines are read
// as the TUM tools read them.
TEST(Trajectory, RoundTripAndTolerance) {
    Trajectory trajectory;
    std::string message;
    const TrajectoryPose pose{1305031229528748123, {1.25, -2.5, 1e-7}, {0.5, -0.5, 0.5, 0.5}};
    ASSERT_EQ(parse_trajectory(pose_line(pose), "f", trajectory, message), Status::kOk) << message;
    ASSERT_EQ(trajectory.size(), 1U);
    EXPECT_EQ(trajectory[0].time_ns, pose.time_ns);
    EXPECT_NEAR(trajectory[0].t[2], 1e-7, 1e-9);
    EXPECT_EQ(trajectory[0].q, pose.q);
    ASSERT_EQ(parse_trajectory("# x\n2, 1,2,3, 0,0,0,2\n1 1 2 3 0 0 0 1\n1.5 nan nan nan nan nan nan nan\n", "f",
                               trajectory, message),
              Status::kOk)
        << message;
    ASSERT_EQ(trajectory.size(), 2U);
    EXPECT_EQ(trajectory[0].time_ns, 1000000000);
    EXPECT_EQ(trajectory[1].q[3], 1.0);
}

// Promise: a line that is no pose is named by file and number.
TEST(Trajectory, NamesBrokenLines) {
    Trajectory trajectory;
    std::string message;
    EXPECT_EQ(parse_trajectory("1 2 3\n", "t.txt", trajectory, message), Status::kInvalid);
    EXPECT_NE(message.find("t.txt, line 1: only 3 words"), std::string::npos) << message;
    EXPECT_EQ(parse_trajectory("\n1 0 0 0 0 0 0 0\n", "t.txt", trajectory, message), Status::kInvalid);
    EXPECT_NE(message.find("t.txt, line 2: the quaternion is zero"), std::string::npos) << message;
    EXPECT_EQ(parse_trajectory("x 0 0 0 0 0 0 1\n", "t.txt", trajectory, message), Status::kInvalid);
    EXPECT_EQ(parse_trajectory("1 0 0 z 0 0 0 1\n", "t.txt", trajectory, message), Status::kInvalid);
    EXPECT_NE(message.find("'z' is not a number"), std::string::npos) << message;
    EXPECT_EQ(read_trajectory("/nowhere/t.txt", trajectory, message), Status::kUnavailable);
}

}  // namespace
}  // namespace stillmesh
