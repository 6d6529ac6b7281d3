#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <cstdint>
#include <limits>
#include <vector>

#include "engine/pose/pose_optimiser.hpp"
#include "engine/pose/residual.hpp"
#include "tests/support/synthetic.hpp"

namespace stillmesh::optimiser_test {
namespace {

using test::all_of;
using test::measure_scene;
using test::Noise;

constexpr double kChi2Max = 11.34;
constexpr double kAll = 1e12;  // a threshold that nothing exceeds

// Residuals by the definition (method.md 1 and 6), whitened: reprojection and depth over their deviations.
Vector3 whitened(const Correspondence& c, const SE3& world_from_camera) {
    const Vector3 q = world_from_camera.inverse() * c.p_world;
    const double sigma_xy = std::sqrt(c.var_pixel + c.map_var_lateral / (q.z() * q.z()));
    const double sigma_z = std::sqrt(c.var_z + c.map_var_z);
    return {(q.x() / q.z() - c.normalised.x()) / sigma_xy, (q.y() / q.z() - c.normalised.y()) / sigma_xy,
            c.has_depth ? (q.z() - c.p_camera.z()) / sigma_z : 0.0};
}

// Hessian and gradient of half the sum of squares by central differences; the variances are held, as in Gauss-Newton.
void differentiate(const std::vector<Correspondence>& correspondences, const SE3& pose, Matrix6& h, Vector6& g) {
    h.setZero();
    g.setZero();
    constexpr double kStep = 1e-6;
    for (const Correspondence& c : correspondences) {
        Correspondence fixed = c;
        const double z = (pose.inverse() * c.p_world).z();
        fixed.var_pixel += c.map_var_lateral / (z * z);
        fixed.map_var_lateral = 0;
        Eigen::Matrix<double, 3, 6> j;
        for (int k = 0; k < 6; ++k) {
            Vector6 xi = Vector6::Zero();
            xi(k) = kStep;
            const Vector3 plus = whitened(fixed, pose * se3_exp(xi));
            xi(k) = -kStep;
            const Vector3 minus = whitened(fixed, pose * se3_exp(xi));
            j.col(k) = (plus - minus) / (2 * kStep);
        }
        const Vector3 r = whitened(fixed, pose);
        h += c.weight * (j.transpose() * j);
        g += c.weight * (j.transpose() * r);
    }
}

// Promise: chi2 is the sum of squared residuals over their variances, for the map's estimate and for the anchor.
TEST(Residual, IsWhatTheMethodSays) {
    Random random(1);
    for (int round = 0; round < 200; ++round) {
        const SE3 pose = test::random_motion(random, 1.0, 0.8);
        auto c = measure_scene(1, pose, {2e-3, 2e-3, 5e-3}, random)[0];
        if (round % 3 == 0) c.has_depth = false;
        c.anchor_var_lateral *= 4;
        c.anchor_var_z *= 3;
        c.p_anchor += test::random_vector(random, 0.02);
        EXPECT_NEAR(chi2_of(c, pose.inverse()), whitened(c, pose).squaredNorm(), 1e-9);
        Correspondence by_anchor = c;
        by_anchor.p_world = c.p_anchor;
        by_anchor.map_var_lateral = c.anchor_var_lateral;
        by_anchor.map_var_z = c.anchor_var_z;
        EXPECT_EQ(chi2_of_anchor(c, pose.inverse()), chi2_of(by_anchor, pose.inverse()));
        c.p_world = c.p_anchor = pose * Vector3(0.1, 0.1, -1.0);
        EXPECT_EQ(chi2_of(c, pose.inverse()), kChi2Behind);
        EXPECT_EQ(chi2_of_anchor(c, pose.inverse()), kChi2Behind);
    }
}

// Promise: the information is that of the right increment xi = [translation, rotation] in the camera frame: it equals
// numerical differentiation.
TEST(PoseOptimiser, InformationEqualsNumericalDifferentiation) {
    Random random(2);
    for (int round = 0; round < 50; ++round) {
        const SE3 pose = test::random_motion(random, 1.0, 0.8);
        auto c = measure_scene(20, pose * test::random_motion(random, 0.02, 0.01), {2e-3, 2e-3, 3e-3}, random);
        for (Correspondence& one : c) {
            one.has_depth = random.below(3) != 0;
            one.weight = random.uniform(0.1, 1.0);
            if (random.below(4) == 0) one.var_z = random.uniform(1, 9);  // far away: little is not nothing
        }
        c[0].weight = 1.0;  // weights are relative to the largest
        const PoseFit fit = optimise_pose(c, all_of(c), pose, kAll, 0);
        Matrix6 h;
        Vector6 g;
        differentiate(c, pose, h, g);
        EXPECT_LT((fit.information - h).norm(), 1e-7 * h.norm());
        EXPECT_EQ(fit.information, Matrix6(fit.information.transpose()));
        // One step of damped Gauss-Newton along the numerical gradient.
        Matrix6 damped = h;
        for (int k = 0; k < 6; ++k) damped(k, k) += 1e-4 * h(k, k);
        const SE3 wanted = pose * se3_exp(Vector6(damped.llt().solve(Vector6(-g))));
        const PoseFit step = optimise_pose(c, all_of(c), pose, kAll, 1);
        EXPECT_LT(test::metres_between(step.world_from_camera, wanted), 1e-7);
        EXPECT_LT(test::radians_between(step.world_from_camera, wanted), 1e-7);
    }
}

// Promise: on exact data the exact pose comes out, from far off, with depth and without.
TEST(PoseOptimiser, IsExactOnExactData) {
    Random random(3);
    for (int round = 0; round < 100; ++round) {
        const SE3 truth = test::random_motion(random, 2.0, 1.0);
        auto c = measure_scene(30, truth, Noise{}, random);
        if (round % 2 == 1) {
            for (Correspondence& one : c) one.has_depth = false;
        }
        const SE3 guess = truth * test::random_motion(random, 0.1, 0.1);
        const PoseFit fit = optimise_pose(c, all_of(c), guess, kAll, 10);
        ASSERT_TRUE(fit.is_valid);
        EXPECT_EQ(fit.inliers, 30U);
        EXPECT_LT(test::metres_between(truth, fit.world_from_camera), 1e-8);
        EXPECT_LT(test::radians_between(truth, fit.world_from_camera), 1e-8);
        EXPECT_LT(fit.mean_chi2, 1e-9);
        EXPECT_LT(
            (fit.world_from_camera.rotation * fit.world_from_camera.rotation.transpose() - Matrix3::Identity()).norm(),
            1e-14);
    }
}

// Promise: the covariance is honest: over many noisy scenes NEES is 6 and chi2 per point is 3 less what was fitted.
TEST(PoseOptimiser, CovarianceIsHonest) {
    for (const Noise noise : {Noise{1.5e-3, 1.5e-3, 0}, Noise{1.5e-3, 3e-3, 4e-3}, Noise{3e-3, 1e-3, 1e-3}}) {
        Random random(4);
        constexpr int kRounds = 400;
        double nees = 0, chi2 = 0;
        Matrix6 spread = Matrix6::Zero();
        for (int round = 0; round < kRounds; ++round) {
            const SE3 truth = test::random_motion(random, 1.0, 0.8);
            const auto c = measure_scene(60, truth, noise, random);
            const PoseFit fit = optimise_pose(c, all_of(c), truth * test::random_motion(random, 0.02, 0.02), kAll, 10);
            ASSERT_TRUE(fit.is_valid);
            const Vector6 xi = se3_log(fit.world_from_camera.inverse() * truth);
            nees += xi.dot(fit.information * xi);
            chi2 += fit.mean_chi2;
            // Whitened errors: their spread is the identity, axis by axis.
            const Vector6 white = fit.information.llt().matrixU() * xi;
            spread += white * white.transpose();
        }
        // Deviation of the mean of 400 chi-squares of 6 degrees of freedom: 0.17.
        EXPECT_NEAR(nees / kRounds, 6.0, 0.6);
        // The map point's own noise is taken as the same in x, y and z, whatever the angle of the ray.
        EXPECT_NEAR(chi2 / kRounds, 3.0 - 6.0 / 60, noise.map_m > 0 ? 0.12 : 0.03);
        EXPECT_LT((spread / kRounds - Matrix6::Identity()).cwiseAbs().maxCoeff(), 0.3);
    }
}

// Promise: robust: gross outliers have next to no say, whatever their number up to a third.
TEST(PoseOptimiser, GrossOutliersHaveNoSay) {
    Random random(5);
    for (int round = 0; round < 30; ++round) {
        const SE3 truth = test::random_motion(random, 1.0, 0.8);
        auto c = measure_scene(90, truth, {1.5e-3, 1.5e-3, 0}, random);
        for (std::size_t i = 0; i < 30; ++i) c[i].p_world += test::random_vector(random, 1.0);
        const SE3 guess = truth * test::random_motion(random, 0.02, 0.01);
        const PoseFit fit = optimise_pose(c, all_of(c), guess, kChi2Max, 10);
        ASSERT_TRUE(fit.is_valid);
        EXPECT_LT(test::metres_between(truth, fit.world_from_camera), 0.01);
        EXPECT_LT(test::radians_between(truth, fit.world_from_camera), 0.006);
        std::uint32_t inliers = 0;
        for (const Correspondence& one : c) {
            inliers += chi2_of(one, fit.world_from_camera.inverse()) <= kChi2Max ? 1U : 0U;
        }
        EXPECT_EQ(fit.inliers, inliers);
    }
}

// Promise: a point that jumps over the camera's plane, the grossest outlier there is, vetoes no step.
TEST(PoseOptimiser, PointsAtTheCameraVetoNothing) {
    Random random(15);
    for (int round = 0; round < 200; ++round) {
        const SE3 truth = test::random_motion(random, 1.0, 0.8);
        auto c = measure_scene(60, truth, Noise{}, random);
        const SE3 guess = truth * test::random_motion(random, 0.02, 0.01);
        for (std::size_t i = 0; i < 5; ++i) {
            c[i].p_world = guess * Vector3(random.uniform(-0.5, 0.5), 0.3, random.uniform(0.03, 0.07));
        }
        const PoseFit fit = optimise_pose(c, all_of(c), guess, kChi2Max, 20);
        ASSERT_TRUE(fit.is_valid);
        EXPECT_EQ(fit.inliers, 55U) << "round " << round;
        EXPECT_LT(test::metres_between(truth, fit.world_from_camera), 1e-4);
    }
}

// Promise: weights are relative: all of them halved give the same bits; a weight of nothing is no point.
TEST(PoseOptimiser, VotesAreRelative) {
    Random random(6);
    const SE3 truth = test::random_motion(random, 1.0, 0.8);
    auto c = measure_scene(50, truth, {1.5e-3, 1.5e-3, 0}, random);
    for (Correspondence& one : c) one.weight = random.uniform(0.1, 1.0);
    const PoseFit fit = optimise_pose(c, all_of(c), truth, kChi2Max, 10);
    for (Correspondence& one : c) one.weight *= 0.5;
    const PoseFit halved = optimise_pose(c, all_of(c), truth, kChi2Max, 10);
    EXPECT_EQ(fit.world_from_camera.rotation, halved.world_from_camera.rotation);
    EXPECT_EQ(fit.world_from_camera.translation, halved.world_from_camera.translation);
    EXPECT_EQ(fit.information, halved.information);
    for (Correspondence& one : c) one.weight = 0;
    EXPECT_FALSE(optimise_pose(c, all_of(c), truth, kChi2Max, 10).is_valid);
}

// Promise: never more passes than allowed; none leaves the guess as it is.
TEST(PoseOptimiser, KeepsItsPasses) {
    Random random(7);
    const SE3 truth = test::random_motion(random, 1.0, 0.8);
    const auto c = measure_scene(50, truth, {1.5e-3, 1.5e-3, 0}, random);
    const SE3 guess = truth * test::random_motion(random, 0.2, 0.3);
    const PoseFit none = optimise_pose(c, all_of(c), guess, kChi2Max, 0);
    EXPECT_EQ(none.world_from_camera.translation, guess.translation);
    EXPECT_EQ(none.world_from_camera.rotation, guess.rotation);
    double before = std::numeric_limits<double>::max();
    for (std::uint32_t passes = 1; passes < 12; ++passes) {
        const PoseFit fit = optimise_pose(c, all_of(c), guess, kAll, passes);
        double cost = 0;
        for (const Correspondence& one : c) cost += chi2_of(one, fit.world_from_camera.inverse());
        EXPECT_LE(cost, before * (1 + 1e-12)) << "a pass made it worse";
        before = cost;
    }
}

// Promise: the order of the points matters by rounding alone.
TEST(PoseOptimiser, OrderMattersByRoundingAlone) {
    Random random(8);
    const SE3 truth = test::random_motion(random, 1.0, 0.8);
    const auto c = measure_scene(80, truth, {1.5e-3, 1.5e-3, 0}, random);
    auto order = all_of(c);
    const PoseFit fit = optimise_pose(c, order, truth, kChi2Max, 10);
    for (std::size_t i = order.size(); i > 1; --i) {
        std::swap(order[i - 1], order[random.below(static_cast<std::uint32_t>(i))]);
    }
    const PoseFit shuffled = optimise_pose(c, order, truth, kChi2Max, 10);
    EXPECT_LT(test::metres_between(fit.world_from_camera, shuffled.world_from_camera), 1e-12);
    EXPECT_LT(test::radians_between(fit.world_from_camera, shuffled.world_from_camera), 1e-12);
    const PoseFit again = optimise_pose(c, order, truth, kChi2Max, 10);
    EXPECT_EQ(shuffled.information, again.information);
    EXPECT_EQ(shuffled.world_from_camera.translation, again.world_from_camera.translation);
}

// Promise: too few points, all in one place, all on a line or behind the camera: no valid fit, and no NaN.
TEST(PoseOptimiser, DegenerateInputGivesNoFit) {
    Random random(9);
    const SE3 truth = test::random_motion(random, 1.0, 0.8);
    const auto expect_none = [&](const std::vector<Correspondence>& c, const char* what) {
        for (const SE3& guess : {truth, truth * test::random_motion(random, 0.02, 0.02)}) {
            const PoseFit fit = optimise_pose(c, all_of(c), guess, kChi2Max, 10);
            EXPECT_FALSE(fit.is_valid) << what;
            EXPECT_TRUE(test::is_finite(fit.world_from_camera)) << what;
            EXPECT_TRUE(fit.information.allFinite()) << what;
        }
    };
    expect_none({}, "nothing");
    for (const std::uint32_t count : {1U, 2U}) expect_none(measure_scene(count, truth, Noise{}, random), "too few");
    std::vector<Correspondence> one, line, behind, ray;
    for (int i = 0; i < 20; ++i) {
        const Vector3 p(0.1, 0.2, 2.0);
        one.push_back(test::measure(p, truth * p, Noise{}, random));
        const Vector3 q(0.02 * i, 0.01 * i, 1.0 + 0.05 * i);
        line.push_back(test::measure(q, truth * q, Noise{}, random));
        const Vector3 r = Vector3(0.1, 0.05, 1.0) * (1.0 + 0.1 * i);
        ray.push_back(test::measure(r, truth * r, Noise{}, random));
        behind.push_back(test::measure(p, truth * Vector3(0.1, 0.2, -2.0), Noise{}, random));
    }
    expect_none(one, "one point");
    expect_none(line, "a line");
    expect_none(ray, "a ray");
    expect_none(behind, "behind the camera");
    // Three good points are enough.
    const auto three = measure_scene(3, truth, Noise{}, random);
    EXPECT_TRUE(optimise_pose(three, all_of(three), truth, kChi2Max, 10).is_valid);
}

// Promise: a sure prior holds a poor frame, a vague one changes nothing that can be measured.
TEST(PoseOptimiser, WeighsThePrior) {
    Random random(10);
    const SE3 truth = test::random_motion(random, 1.0, 0.8);
    const auto c = measure_scene(40, truth, {1.5e-3, 1.5e-3, 0}, random);
    const PoseFit free = optimise_pose(c, all_of(c), truth, kAll, 20);
    MotionPrior prior;
    prior.world_from_camera = truth * test::random_motion(random, 0.05, 0.03);
    prior.sigma_m = prior.sigma_rad = 1e3;
    const PoseFit vague = optimise_pose(c, all_of(c), truth, kAll, 20, &prior);
    EXPECT_LT(test::metres_between(free.world_from_camera, vague.world_from_camera), 1e-7);
    prior.sigma_m = prior.sigma_rad = 1e-7;
    const PoseFit sure = optimise_pose(c, all_of(c), truth, kAll, 20, &prior);
    EXPECT_LT(test::metres_between(prior.world_from_camera, sure.world_from_camera), 1e-5);
    EXPECT_LT(test::radians_between(prior.world_from_camera, sure.world_from_camera), 1e-5);
    // In between: information adds up.
    prior.sigma_m = 0.002;
    prior.sigma_rad = 0.004;
    const PoseFit fit = optimise_pose(c, all_of(c), free.world_from_camera, kAll, 0, &prior);
    const PoseFit without = optimise_pose(c, all_of(c), free.world_from_camera, kAll, 0);
    Matrix6 added = Matrix6::Zero();
    for (int i = 0; i < 6; ++i) added(i, i) = i < 3 ? 1 / (0.002 * 0.002) : 1 / (0.004 * 0.004);
    EXPECT_LT((fit.information - without.information - added).norm(), 1e-9 * fit.information.norm());
    // With one point in all, the prior makes a pose of it.
    std::vector<Correspondence> one(5, c[0]);
    EXPECT_TRUE(optimise_pose(one, all_of(one), truth, kAll, 20, &prior).is_valid);
}

// Promise: the inverse is the inverse; what is not positive definite has none.
TEST(InvertSpd, InvertsAndRefuses) {
    Random random(11);
    for (int round = 0; round < 200; ++round) {
        Matrix6 a;
        for (int i = 0; i < 6; ++i) {
            for (int j = 0; j < 6; ++j) a(i, j) = random.uniform(-1, 1);
        }
        const Matrix6 spd = a * a.transpose() + 0.01 * Matrix6::Identity();
        Matrix6 inverse;
        ASSERT_TRUE(invert_spd(spd, inverse));
        EXPECT_LT((spd * inverse - Matrix6::Identity()).norm(), 1e-9);
        Matrix6 indefinite = spd;
        indefinite(round % 6, round % 6) = -1;
        EXPECT_FALSE(invert_spd(indefinite, inverse));
        const Vector6 column = a.col(0);
        EXPECT_FALSE(invert_spd(1e6 * column * column.transpose(), inverse)) << "rank 1";
    }
    Matrix6 inverse;
    EXPECT_FALSE(invert_spd(Matrix6::Zero(), inverse));
    EXPECT_FALSE(invert_spd(Matrix6::Constant(std::numeric_limits<double>::quiet_NaN()), inverse));
}

}  // namespace
}  // namespace stillmesh::optimiser_test
