// The same problems solved by Ceres, in a process of its own (ceres_reference.cpp says what the file holds).
#include <gtest/gtest.h>

#include <cmath>
#include <cstdio>
#include <fstream>
#include <iomanip>
#include <string>
#include <vector>

#include "engine/adjust/global_adjustment.hpp"
#include "tests/adjust/global_window.hpp"
#include "tests/adjust/window.hpp"
#include "tests/support/memory.hpp"
#include "tests/support/temporary_folder.hpp"

namespace stillmesh::ceres_test {
namespace {

using test::make_window;
using test::Window;
using test::WindowOptions;

struct Solution {
    double cost = 0;
    std::vector<SE3> poses;
    std::vector<Vector3> points;
};

Solution solve_by_ceres(const Window& window, const AdjustmentOptions& options, const std::string& name) {
    const test::TemporaryFolder folder;
    const std::string file = folder.path(name + ".adjustment");
    {
        std::ofstream out(file);
        out << std::setprecision(17) << options.chi2_max_pixel << ' ' << options.chi2_max_depth << ' '
            << window.poses.size() << ' ' << window.points.size() << ' ' << window.observations.size() << '\n';
        for (std::size_t i = 0; i < window.poses.size(); ++i) {
            out << (window.is_fixed[i] ? 1 : 0);
            for (int r = 0; r < 3; ++r) {
                for (int c = 0; c < 3; ++c) out << ' ' << window.poses[i].rotation(r, c);
            }
            for (int k = 0; k < 3; ++k) out << ' ' << window.poses[i].translation(k);
            out << '\n';
        }
        for (const Vector3& p : window.points) out << p.x() << ' ' << p.y() << ' ' << p.z() << '\n';
        for (const AdjustmentObservation& o : window.observations) {
            out << o.keyframe << ' ' << o.point << ' ' << o.x << ' ' << o.y << ' ' << o.var_pixel << ' ' << o.z_m << ' '
                << o.var_z << '\n';
        }
    }
    Solution solution;
    const std::string command = std::string(CERES_REFERENCE) + " " + file;
    std::FILE* pipe = popen(command.c_str(), "r");
    EXPECT_NE(pipe, nullptr);
    if (pipe == nullptr) return solution;
    std::vector<double> numbers;
    double number = 0;
    while (std::fscanf(pipe, "%lf", &number) == 1) numbers.push_back(number);
    EXPECT_EQ(pclose(pipe), 0) << command;
    EXPECT_EQ(numbers.size(), 1 + 12 * window.poses.size() + 3 * window.points.size());
    if (numbers.size() != 1 + 12 * window.poses.size() + 3 * window.points.size()) return solution;
    const double* at = numbers.data();
    solution.cost = *at++;
    for (std::size_t i = 0; i < window.poses.size(); ++i) {
        SE3 pose;
        for (int r = 0; r < 3; ++r) {
            for (int c = 0; c < 3; ++c) pose.rotation(r, c) = *at++;
        }
        for (int k = 0; k < 3; ++k) pose.translation(k) = *at++;
        solution.poses.push_back(pose);
    }
    for (std::size_t i = 0; i < window.points.size(); ++i) {
        solution.points.emplace_back(at[0], at[1], at[2]);
        at += 3;
    }
    return solution;
}

void expect_same_minimum(const WindowOptions& window_options, double threshold_scale) {
    const Window window = make_window(window_options);
    AdjustmentOptions options;
    options.iterations_max[0] = 2000;  // where an outlier rules a point, reweighting creeps
    options.iterations_max[1] = 0;
    options.cost_change_min = 1e-15;
    options.chi2_max_pixel *= threshold_scale;
    options.chi2_max_depth *= threshold_scale;
    test::InMemory<LocalAdjustment> adjustment(window.sizes());
    ASSERT_TRUE(window.load(*adjustment));
    adjustment->start(options);
    ASSERT_EQ(test::run_to_end(*adjustment), Progress::kDone);
    const Solution reference = solve_by_ceres(window, options, "seed" + std::to_string(window_options.seed));
    ASSERT_EQ(reference.poses.size(), window.poses.size());
    const double cost = adjustment->summary().final_cost;
    EXPECT_LT(std::abs(cost - reference.cost), 1e-6 * reference.cost);
    for (std::uint32_t i = 0; i < adjustment->keyframes(); ++i) {
        const Vector6 off = se3_log(reference.poses[i].inverse() * adjustment->pose(i));
        EXPECT_LT(std::sqrt(off.squaredNorm()), 1e-6) << "keyframe " << i;
    }
    double worst_m = 0;
    for (std::uint32_t i = 0; i < adjustment->points(); ++i) {
        if (!adjustment->is_point_used(i)) continue;
        worst_m = std::max(worst_m, std::sqrt((reference.points[i] - adjustment->point(i)).squaredNorm()));
    }
    EXPECT_LT(worst_m, 1e-4);
    std::printf("cost %.9g, Ceres %.9g, %u iterations, points within %.2g m\n", cost, reference.cost,
                adjustment->summary().iterations, worst_m);
}

// Promise: without outliers the minimum is the reference solver's.
TEST(Ceres, SameMinimumWithoutOutliers) {
    for (std::uint64_t seed = 1; seed <= 3; ++seed) {
        WindowOptions options;
        options.seed = seed;
        expect_same_minimum(options, 1e10);
    }
}

// Promise: the same when few observations have depth. (Points need two: one ray alone is skipped here, not by Ceres.)
TEST(Ceres, SameMinimumWithLittleDepth) {
    WindowOptions options;
    options.seed = 4;
    options.depth_share = 0.5;
    options.observations = 1200;
    options.free = 8;
    expect_same_minimum(options, 1e10);
}

// Promise: with ten times the noise in every tenth observation, Huber's minimum is the reference solver's.
TEST(Ceres, SameMinimumWithHuber) {
    for (std::uint64_t seed = 5; seed <= 7; ++seed) {
        WindowOptions options;
        options.seed = seed;
        options.outlier_share = 0.1;
        options.outlier_scale = 10;
        options.observations = 1000;
        expect_same_minimum(options, 1.0);
    }
}

// Promise: the same for a window of full size, with Huber's cost for what the noise throws beyond the threshold.
TEST(Ceres, SameMinimumOfALargeWindow) {
    WindowOptions options;
    options.seed = 8;
    options.free = 10;
    options.fixed = 10;
    options.points = 1500;
    options.observations = 8000;
    expect_same_minimum(options, 1.0);
}

// Promise: the global adjustment, which never forms a matrix, has the reference solver's minimum too: keyframes, points
// and cost (its observations are kept in single precision).
TEST(Ceres, GlobalAdjustmentHasTheSameMinimum) {
    for (std::uint64_t seed = 11; seed <= 13; ++seed) {
        WindowOptions window_options;
        window_options.seed = seed;
        window_options.free = seed == 13 ? 30 : 10;
        window_options.fixed = 1;
        window_options.points = seed == 13 ? 900 : 300;
        window_options.observations = seed == 13 ? 6000 : 1800;
        const Window window = make_window(window_options);
        const AdjustmentOptions thresholds;
        test::InMemory<GlobalAdjustment> adjustment(test::global_sizes(window));
        ASSERT_TRUE(test::load(window, *adjustment));
        adjustment->start(test::exact_global_options());
        WorkBudget budget(UINT32_MAX);
        ASSERT_EQ(adjustment->step(budget), Progress::kDone);
        const Solution reference = solve_by_ceres(window, thresholds, "global" + std::to_string(seed));
        ASSERT_EQ(reference.poses.size(), window.poses.size());
        const double cost = adjustment->summary().final_cost;
        EXPECT_LT(std::abs(cost - reference.cost), 1e-5 * reference.cost);
        double worst = 0, worst_m = 0;
        for (std::uint32_t i = 0; i < adjustment->keyframes(); ++i) {
            worst =
                std::max(worst, std::sqrt(se3_log(reference.poses[i].inverse() * adjustment->pose(i)).squaredNorm()));
        }
        for (std::uint32_t i = 0; i < adjustment->points(); ++i) {
            if (!adjustment->is_point_used(i)) continue;
            worst_m = std::max(worst_m, std::sqrt((reference.points[i] - adjustment->point(i)).squaredNorm()));
        }
        EXPECT_LT(worst, 1e-5);
        EXPECT_LT(worst_m, 1e-4);
        std::printf(
            "global: cost %.9g from %.4g, Ceres %.9g, poses within %.2g, points %.2g; %u iterations, %u inner\n", cost,
            adjustment->summary().initial_cost, reference.cost, worst, worst_m, adjustment->summary().iterations,
            adjustment->summary().inner_iterations);
    }
}

}  // namespace
}  // namespace stillmesh::ceres_test
