#include "platform/evaluation/evaluation.hpp"

#include <gtest/gtest.h>
#include <sys/stat.h>

#include <algorithm>
#include <cmath>
#include <cstdint>
#include <cstdlib>
#include <filesystem>
#include <limits>
#include <string>
#include <tuple>
#include <utility>
#include <vector>

#include "engine/base/random.hpp"
#include "platform/linux/process.hpp"
#include "tests/replay/recording_folder.hpp"
#include "tests/support/temporary_folder.hpp"

namespace stillmesh::evaluation_test {
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

// The pairs of TUM's associate.py: every candidate within the window, the smallest gap first.
std::vector<std::pair<std::size_t, std::size_t>> pairs_by_all(const Trajectory& truth, const Trajectory& estimate,
                                                              std::int64_t gap_max_ns) {
    std::vector<std::tuple<std::int64_t, std::size_t, std::size_t>> candidates;
    for (std::size_t e = 0; e < estimate.size(); ++e) {
        for (std::size_t t = 0; t < truth.size(); ++t) {
            const std::int64_t gap_ns = truth[t].time_ns - estimate[e].time_ns;
            if (gap_ns >= -gap_max_ns && gap_ns < gap_max_ns) candidates.emplace_back(std::abs(gap_ns), t, e);
        }
    }
    std::sort(candidates.begin(), candidates.end());
    std::vector<bool> is_truth_used(truth.size()), is_estimate_used(estimate.size());
    std::vector<std::pair<std::size_t, std::size_t>> pairs;
    for (const auto& [gap_ns, t, e] : candidates) {
        if (is_truth_used[t] || is_estimate_used[e]) continue;
        is_truth_used[t] = is_estimate_used[e] = true;
        pairs.emplace_back(e, t);
    }
    std::sort(pairs.begin(), pairs.end());
    return pairs;
}

// Promise: poses are paired as by looking at every pair there is, also where many share a time or lie as far from each
// other.
TEST(Evaluation, PairsAreThoseOfAllCandidates) {
    Random random(7);
    std::size_t compared = 0;
    for (int round = 0; round < 3000; ++round) {
        Trajectory both[2];
        for (Trajectory& trajectory : both) {
            trajectory.resize(3 + random.below(12));
            for (TrajectoryPose& pose : trajectory) {
                pose.time_ns = static_cast<std::int64_t>(random.below(round % 2 == 0 ? 12 : 60));
                for (double& t : pose.t) t = random.uniform();
            }
            std::sort(trajectory.begin(), trajectory.end(),
                      [](const TrajectoryPose& a, const TrajectoryPose& b) { return a.time_ns < b.time_ns; });
        }
        const auto gap_max_ns = static_cast<std::int64_t>(random.below(8));
        const auto wanted = pairs_by_all(both[0], both[1], gap_max_ns);
        const auto result = evaluate(both[0], both[1], {.gap_max_ns = gap_max_ns});
        ASSERT_EQ(result.has_value(), wanted.size() >= 3);
        if (!result) continue;
        std::vector<std::pair<std::size_t, std::size_t>> got;
        for (const PosePair& pair : result->pairs) got.emplace_back(pair.estimate_index, pair.truth_index);
        ASSERT_EQ(got, wanted) << round;
        compared += got.size();
    }
    EXPECT_GT(compared, 5000U);
}

// Promise: many poses of one time take no more room than as many of their own: 200 000 here, where all pairs would be
// 10^10.
TEST(Evaluation, EqualTimesCostNoMemory) {
    Trajectory truth(100'000), estimate(100'000);
    for (Trajectory* const trajectory : {&truth, &estimate}) {
        for (std::size_t i = 0; i < trajectory->size(); ++i) {
            (*trajectory)[i].time_ns = i < 10 ? static_cast<std::int64_t>(i) * 1'000'000'000 : 20'000'000'000;
            (*trajectory)[i].t = {static_cast<double>(i % 7), static_cast<double>(i % 5), 0};
        }
    }
    const std::size_t before = peak_resident_bytes();
    const auto result = evaluate(truth, estimate);
    ASSERT_TRUE(result.has_value());
    EXPECT_EQ(result->pairs.size(), 100'000U);
    EXPECT_LT(result->ate_max_m, 1e-9);
    EXPECT_LT(peak_resident_bytes() - before, std::size_t{200} << 20U);
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
    EXPECT_EQ(parse_trajectory("1 0 0 0 0 0 0 1 5\n", "t.txt", trajectory, message), Status::kInvalid);
    EXPECT_NE(message.find("line 1: 9 words; a line is"), std::string::npos) << message;
    EXPECT_EQ(parse_trajectory("1,5, 0,0, 0,1, 0,2, 0,0, 0,0, 0,0, 1,0\n", "t.txt", trajectory, message), Status::kOk)
        << message;
    EXPECT_EQ(parse_trajectory("1,5,0,0,0,1,0,2,0,0,0,0,0,0,1,0\n", "t.txt", trajectory, message), Status::kInvalid);
    EXPECT_NE(message.find("16 words (are there decimal commas?)"), std::string::npos) << message;
    EXPECT_EQ(read_trajectory("/nowhere/t.txt", trajectory, message), Status::kUnavailable);
}

// Promise: decimal commas and a byte order mark are read; columns parted by commas are as well.
TEST(Trajectory, OtherSpellings) {
    Trajectory plain, other;
    std::string message;
    ASSERT_EQ(parse_trajectory("1.5 0.25 -1 2 0 0 0 1\n", "f", plain, message), Status::kOk);
    for (const char* const text : {"1,5 0,25 -1 2 0 0 0 1\n", "\xef\xbb\xbf# x\n1.5 0.25 -1 2 0 0 0 1\r\n",
                                   "\xef\xbb\xbf"
                                   "1.5,0.25,-1,2,0,0,0,1",
                                   "1.5, 0.25, -1, 2, 0, 0, 0, 1\n", "\t1,5\t0,25 -1,0 2,0 0 0 0 1"}) {
        ASSERT_EQ(parse_trajectory(text, "f", other, message), Status::kOk) << message;
        ASSERT_EQ(other.size(), 1U) << text;
        EXPECT_EQ(other[0].time_ns, plain[0].time_ns) << text;
        EXPECT_EQ(other[0].t, plain[0].t) << text;
        EXPECT_EQ(other[0].q, plain[0].q) << text;
    }
}

// Promise: what is no file is refused at once, and a file of gigabytes is not read.
TEST(Trajectory, OnlyFilesAreRead) {
    const test::TemporaryFolder folder;
    Trajectory trajectory;
    std::string message;
    ASSERT_EQ(::mkfifo(folder.path("pipe").c_str(), 0600), 0);
    for (const std::string& file : {folder.path("pipe"), folder.path(), std::string("/dev/zero")}) {
        EXPECT_EQ(read_trajectory(file, trajectory, message), Status::kUnavailable);
        EXPECT_NE(message.find(file + ": cannot be read: it is no regular file"), std::string::npos) << message;
    }
    test::write_text(folder.path("sparse"), "1 0 0 0 0 0 0 1\n");
    std::filesystem::resize_file(folder.path("sparse"), std::uintmax_t{3} << 30U);
    EXPECT_EQ(read_trajectory(folder.path("sparse"), trajectory, message), Status::kUnavailable);
    EXPECT_NE(message.find("it is larger than such a file can be"), std::string::npos) << message;
}

// Promise: the scale that would fit best is told, and is not used.
TEST(Evaluation, TellsTheScale) {
    const Trajectory truth = load("truth.txt");
    for (const double factor : {0.2, 1.0, 5.0}) {
        Trajectory scaled = truth;
        for (TrajectoryPose& pose : scaled) {
            for (double& t : pose.t) t *= factor;
        }
        const auto result = evaluate(truth, scaled);
        ASSERT_TRUE(result.has_value());
        EXPECT_NEAR(result->scale, 1 / factor, 1e-9);
        EXPECT_EQ(result->ate_rmse_m > 0.1, factor != 1.0);
    }
    Trajectory still = truth;
    for (TrajectoryPose& pose : still) pose.t = {1, 2, 3};
    EXPECT_EQ(evaluate(truth, still)->scale, 1.0);
}

}  // namespace
}  // namespace stillmesh::evaluation_test
