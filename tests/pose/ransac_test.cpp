#include "engine/pose/ransac.hpp"

#include <gtest/gtest.h>

#include <bit>
#include <cmath>
#include <cstdint>
#include <vector>

#include "engine/pose/pose_optimiser.hpp"
#include "engine/pose/residual.hpp"
#include "tests/support/synthetic.hpp"

namespace stillmesh::ransac_test {
namespace {

using test::all_of;
using test::measure_scene;
using test::Noise;

// `share` of the correspondences become nonsense: the map believes the point elsewhere.
std::vector<bool> spoil(std::vector<Correspondence>& correspondences, double share, Random& random) {
    std::vector<bool> is_outlier(correspondences.size());
    const auto count = static_cast<std::size_t>(share * static_cast<double>(correspondences.size()));
    for (std::size_t i = 0; i < count; ++i) {
        const Vector3 off = test::random_vector(random, 1.0);
        correspondences[i].p_world += off + off.normalized() * 0.3;
        is_outlier[i] = true;
    }
    return is_outlier;
}

bool is_same(const SE3& a, const SE3& b) {
    return a.rotation == b.rotation && a.translation == b.translation;
}

// Promise: the iteration rule is k = ceil(log(1 - p) / log(1 - r^3)), at least 1, at most the cap (method.md 6).
TEST(Ransac, IterationRule) {
    for (const double p : {0.5, 0.9, 0.99, 0.9999}) {
        for (int i = 1; i < 1000; ++i) {
            const double r = i / 1000.0;
            const double exact = std::log(1 - p) / std::log(1 - r * r * r);
            if (std::abs(exact - std::round(exact)) < 1e-6) continue;  // too close to call for either arithmetic
            const double wanted = std::min(std::max(std::ceil(exact), 1.0), 5000.0);
            EXPECT_EQ(ransac_iterations(p, r, 5000), static_cast<std::uint32_t>(wanted)) << "p " << p << " r " << r;
        }
    }
    EXPECT_EQ(ransac_iterations(0.99, 1.0, 100), 1U);
    EXPECT_EQ(ransac_iterations(0.99, 0.9, 100), 4U);
    EXPECT_EQ(ransac_iterations(0.99, 0.0, 100), 100U);
    EXPECT_EQ(3 * ransac_iterations(0.99, 0.3, 5000), 507U);
    EXPECT_EQ(10 * ransac_iterations(0.99, 0.3, 5000), 1690U);
}

// Promise: three exact points give the exact motion.
TEST(PoseFromThree, IsExactOnExactPoints) {
    Random random(3);
    int solved = 0;
    for (int round = 0; round < 2000; ++round) {
        const SE3 truth = test::random_motion(random, 2.0, 1.5);
        const auto c = measure_scene(3, truth, Noise{}, random);
        const Vector3 u = c[1].p_camera - c[0].p_camera;
        const Vector3 v = c[2].p_camera - c[0].p_camera;
        SE3 pose;
        if (!pose_from_three(c[0], c[1], c[2], pose)) {
            EXPECT_LT(u.cross(v).norm() / (u.norm() * v.norm()), 0.3) << "refused a good triangle";
            continue;
        }
        ++solved;
        // How much a triangle turns rounding errors into rotation: long over narrow.
        const double spread = std::max(u.norm(), v.norm()) / u.cross(v).norm();
        EXPECT_LT(test::metres_between(truth, pose), 1e-13 * (1 + 20 * spread));
        EXPECT_LT(test::radians_between(truth, pose), 1e-13 * (1 + 20 * spread));
    }
    EXPECT_GT(solved, 1900);
}

// Promise: a triangle that cannot fix a rotation, or whose shape changed by more than its noise allows, is refused.
TEST(PoseFromThree, RefusesDegenerateAndDeformedTriangles) {
    Random random(4);
    const SE3 truth = test::random_motion(random, 1.0, 0.5);
    const auto at = [&](double x, double y, double z) {
        const Vector3 p(x, y, z);
        return test::measure(p, truth * p, Noise{}, random);
    };
    SE3 pose;
    EXPECT_TRUE(pose_from_three(at(0, 0, 2), at(1, 0, 2), at(0, 1, 2), pose));
    EXPECT_FALSE(pose_from_three(at(0, 0, 2), at(0, 0, 2), at(0, 0, 2), pose)) << "one point";
    EXPECT_FALSE(pose_from_three(at(0, 0, 2), at(0, 0, 2), at(0, 1, 2), pose)) << "two points";
    EXPECT_FALSE(pose_from_three(at(0, 0, 2), at(0.1, 0.2, 2.1), at(0.2, 0.4, 2.2), pose)) << "a line";
    EXPECT_FALSE(pose_from_three(at(-0.1, -0.2, 1.9), at(0, 0, 2), at(0.1, 0.2, 2.1), pose)) << "a line, from inside";
    EXPECT_FALSE(pose_from_three(at(0, 0, 2), at(1e-3, 0, 2), at(0, 1e-3, 2), pose)) << "smaller than its noise";
    auto moved = at(0, 1, 2);
    moved.p_world += truth.rotation * Vector3(0, 0.1, 0);
    EXPECT_FALSE(pose_from_three(at(0, 0, 2), at(1, 0, 2), moved, pose)) << "another shape";
    moved.map_var_z = 0.01;
    EXPECT_TRUE(pose_from_three(at(0, 0, 2), at(1, 0, 2), moved, pose)) << "another shape, within its noise";
}

// Promise: with up to 60 % of outliers the right pose is found, all inliers are counted and no outlier is.
TEST(Ransac, FindsThePoseAmongOutliers) {
    for (const double share : {0.0, 0.2, 0.4, 0.6}) {
        for (std::uint64_t seed = 0; seed < 25; ++seed) {
            Random random(100 * seed + 7);
            const SE3 truth = test::random_motion(random, 1.0, 0.8);
            auto c = measure_scene(150, truth, Noise{}, random);
            const auto is_outlier = spoil(c, share, random);
            RansacOptions options;
            options.factor = 10;
            options.iterations_max = 1690;
            options.inlier_ratio_start = 0.3;
            Random samples(seed);
            const RansacResult result = ransac_pose(c, all_of(c), nullptr, options, samples);
            ASSERT_TRUE(result.is_valid);
            EXPECT_LT(test::metres_between(truth, result.world_from_camera), 1e-9) << share << " seed " << seed;
            EXPECT_LT(test::radians_between(truth, result.world_from_camera), 1e-9) << share << " seed " << seed;
            std::uint32_t inliers = 0;
            for (std::size_t i = 0; i < c.size(); ++i) {
                const bool is_inlier = chi2_of(c[i], result.world_from_camera.inverse()) <= options.chi2_max;
                EXPECT_EQ(is_inlier, !is_outlier[i]) << i;
                inliers += is_inlier ? 1U : 0U;
            }
            EXPECT_EQ(result.inliers, inliers);
            EXPECT_DOUBLE_EQ(result.inlier_share, inliers / 150.0);
        }
    }
}

// Promise: noise, too: with half of the matches wrong, the pose refined on the inliers is as good as its covariance
// says.
TEST(Ransac, ServesTheOptimiserUnderNoise) {
    double nees = 0;
    constexpr std::uint64_t kRounds = 50;
    for (std::uint64_t seed = 0; seed < kRounds; ++seed) {
        Random random(seed + 900);
        const SE3 truth = test::random_motion(random, 1.0, 0.8);
        auto c = measure_scene(200, truth, {1.5e-3, 1.5e-3, 0}, random);
        spoil(c, 0.5, random);
        RansacOptions options;
        options.factor = 10;
        options.iterations_max = 1690;
        const RansacResult result = ransac_pose(c, all_of(c), nullptr, options, random);
        ASSERT_TRUE(result.is_valid);
        const PoseFit fit = optimise_pose(c, all_of(c), result.world_from_camera, options.chi2_max, 10);
        ASSERT_TRUE(fit.is_valid);
        const Vector6 xi = se3_log(fit.world_from_camera.inverse() * truth);
        nees += xi.dot(fit.information * xi) / static_cast<double>(kRounds);
    }
    EXPECT_GT(nees, 5.0);
    EXPECT_LT(nees, 7.5);
}

// Promise: the number of hypotheses follows the rule and never exceeds the hard cap.
TEST(Ransac, KeepsTheIterationRuleAndTheCap) {
    Random random(5);
    const SE3 truth = test::random_motion(random, 1.0, 0.8);
    auto c = measure_scene(100, truth, Noise{}, random);
    RansacOptions options;
    Random samples(1);
    // All agree with what it starts from: r = 1, k = 1.
    EXPECT_EQ(ransac_pose(c, all_of(c), &truth, options, samples).iterations, options.factor);
    // Nothing ever agrees: as many as the start ratio asks for, clamped at r = 0.3 and at the cap.
    spoil(c, 1.0, random);
    options.iterations_max = 5000;
    for (const double r : {0.0, 0.1, 0.3, 0.5, 0.8}) {
        options.inlier_ratio_start = r;
        EXPECT_EQ(ransac_pose(c, all_of(c), nullptr, options, samples).iterations,
                  options.factor * ransac_iterations(options.confidence, std::max(r, 0.3), 5000));
    }
    for (const std::uint32_t cap : {1U, 2U, 17U, 100U}) {
        options.inlier_ratio_start = 0.3;
        options.iterations_max = cap;
        EXPECT_EQ(ransac_pose(c, all_of(c), nullptr, options, samples).iterations, cap);
    }
}

// Promise: what cannot give a pose gives none: no crash, no NaN.
TEST(Ransac, DegenerateInputGivesNoPose) {
    Random random(6);
    const SE3 truth = test::random_motion(random, 1.0, 0.8);
    const RansacOptions options;
    const auto expect_none = [&](const std::vector<Correspondence>& c, const char* what) {
        Random samples(2);
        const RansacResult none = ransac_pose(c, all_of(c), nullptr, options, samples);
        EXPECT_FALSE(none.is_valid) << what;
        EXPECT_EQ(none.inliers, 0U) << what;
        EXPECT_EQ(none.inlier_share, 0.0) << what;
        EXPECT_LE(none.iterations, options.iterations_max) << what;
        // A hypothesis to start from is judged all the same, and comes back when nothing is better.
        const RansacResult given = ransac_pose(c, all_of(c), &truth, options, samples);
        EXPECT_TRUE(is_same(given.world_from_camera, truth)) << what;
        EXPECT_EQ(given.inliers, c.size()) << what;
    };
    expect_none({}, "nothing");
    for (const std::uint32_t count : {1U, 2U}) expect_none(measure_scene(count, truth, Noise{}, random), "too few");
    std::vector<Correspondence> line, one, flat;
    for (int i = 0; i < 30; ++i) {
        const Vector3 p(0.02 * i, 0.01 * i, 1.0 + 0.05 * i);
        line.push_back(test::measure(p, truth * p, Noise{}, random));
        const Vector3 q(0.1, 0.2, 2.0);
        one.push_back(test::measure(q, truth * q, Noise{}, random));
        flat.push_back(test::measure(test::random_point_in_view(random), Vector3::Zero(), Noise{}, random));
        flat.back().p_world = truth * flat.back().p_camera;
        flat.back().has_depth = false;
    }
    expect_none(line, "a line");
    expect_none(one, "one point");
    expect_none(flat, "no depth");
    const auto three = measure_scene(3, truth, Noise{}, random);
    Random samples(2);
    const RansacResult result = ransac_pose(three, all_of(three), nullptr, options, samples);
    EXPECT_TRUE(result.is_valid);
    EXPECT_LT(test::metres_between(truth, result.world_from_camera), 1e-9);
    // A weight of nothing at all.
    auto mute = measure_scene(30, truth, Noise{}, random);
    for (Correspondence& c : mute) c.weight = 0;
    const RansacResult silent = ransac_pose(mute, all_of(mute), nullptr, options, samples);
    EXPECT_TRUE(test::is_finite(silent.world_from_camera));
    EXPECT_EQ(silent.inlier_share, 0.0);
}

// Promise: weights decide, not numbers: few trusted points beat many that the past does not know.
TEST(Ransac, VotesDecide) {
    Random random(8);
    const SE3 truth = test::random_motion(random, 1.0, 0.5);
    const SE3 other = truth * test::random_motion(random, 0.3, 0.2);
    auto c = measure_scene(40, truth, Noise{}, random);
    for (const Correspondence& moving : measure_scene(80, other, Noise{}, random)) {
        c.push_back(moving);
        c.back().weight = 0.1;
    }
    RansacOptions options;
    options.inlier_ratio_start = 0.3;
    RansacResult result = ransac_pose(c, all_of(c), nullptr, options, random);
    EXPECT_LT(test::metres_between(truth, result.world_from_camera), 1e-6);
    for (Correspondence& one : c) one.weight = 1;
    result = ransac_pose(c, all_of(c), nullptr, options, random);
    EXPECT_LT(test::metres_between(other, result.world_from_camera), 1e-6);
}

// Promise: same input, same bits; and correspondences that are not named have no say.
TEST(Ransac, IsDeterministicAndSeesOnlyTheNamed) {
    Random random(9);
    const SE3 truth = test::random_motion(random, 1.0, 0.5);
    auto c = measure_scene(120, truth, {1.5e-3, 1.5e-3, 0}, random);
    spoil(c, 0.5, random);
    std::vector<std::uint16_t> even;
    for (std::uint16_t i = 0; i < 120; i += 2) even.push_back(i);
    Random a(77), b(77);
    const RansacResult first = ransac_pose(c, even, nullptr, RansacOptions{}, a);
    for (std::size_t i = 1; i < c.size(); i += 2) c[i] = Correspondence{};
    const RansacResult second = ransac_pose(c, even, nullptr, RansacOptions{}, b);
    EXPECT_TRUE(is_same(first.world_from_camera, second.world_from_camera));
    EXPECT_EQ(first.iterations, second.iterations);
    EXPECT_EQ(first.inliers, second.inliers);
    EXPECT_EQ(a.next(), b.next());
}

}  // namespace
}  // namespace stillmesh::ransac_test
