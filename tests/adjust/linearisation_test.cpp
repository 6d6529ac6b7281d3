#include "engine/adjust/linearisation.hpp"

#include <gtest/gtest.h>

#include "engine/base/random.hpp"
#include "tests/adjust/window.hpp"

namespace stillmesh::linearisation_test {
namespace {

struct Residuals {
    double of[3];
};

Residuals residuals_at(const SE3& pose, const Vector3& point, const Sighting& seen) {
    const double p[3] = {point.x(), point.y(), point.z()};
    const SightingResidual r = sighting_residual(camera_rows(pose), p, seen);
    EXPECT_FALSE(r.is_far());
    return {{r.x, r.y, r.z}};
}

// Promise: the derivatives by the pose (right increment) and by the point are those of the residuals.
TEST(Linearisation, DerivativesAreThoseOfTheResiduals) {
    Random random(3);
    for (int n = 0; n < 200; ++n) {
        const SE3 pose = test::draw_motion(random, 2.0, 2.0);
        Vector3 q = test::draw_vector(random, 1.0);
        q.z() = random.uniform(0.5, 4.0);
        const Vector3 point = pose * q;
        Sighting seen;
        seen.x = random.uniform(-0.5, 0.5);
        seen.y = random.uniform(-0.5, 0.5);
        seen.z_m = random.uniform(0.5, 4.0);
        seen.info = seen.info_z = 1.0;
        const double p[3] = {point.x(), point.y(), point.z()};
        const CameraRows camera = camera_rows(pose);
        const SightingResidual r = sighting_residual(camera, p, seen);
        const PoseRows by_pose = pose_rows(r);
        const PointRows by_point = point_rows(camera, r);
        constexpr double kStep = 1e-6;
        for (int k = 0; k < 6; ++k) {
            Vector6 xi = Vector6::Zero();
            xi(k) = kStep;
            const Residuals after = residuals_at(pose * se3_exp(xi), point, seen);
            const Residuals before = residuals_at(pose * se3_exp(-xi), point, seen);
            EXPECT_NEAR((after.of[0] - before.of[0]) / (2 * kStep), by_pose.x[k], 1e-7) << k;
            EXPECT_NEAR((after.of[1] - before.of[1]) / (2 * kStep), by_pose.y[k], 1e-7) << k;
            EXPECT_NEAR((after.of[2] - before.of[2]) / (2 * kStep), by_pose.z[k], 1e-7) << k;
        }
        for (int k = 0; k < 3; ++k) {
            Vector3 d = Vector3::Zero();
            d(k) = kStep;
            const Residuals after = residuals_at(pose, point + d, seen);
            const Residuals before = residuals_at(pose, point - d, seen);
            EXPECT_NEAR((after.of[0] - before.of[0]) / (2 * kStep), by_point.x[k], 1e-7) << k;
            EXPECT_NEAR((after.of[1] - before.of[1]) / (2 * kStep), by_point.y[k], 1e-7) << k;
            EXPECT_NEAR((after.of[2] - before.of[2]) / (2 * kStep), by_point.z[k], 1e-7) << k;
        }
    }
}

// Promise: Huber's weight is the derivative of its cost, and both are continuous at the threshold.
TEST(Linearisation, HuberWeightIsTheDerivativeOfItsCost) {
    constexpr double kThreshold = 7.815;
    for (double chi2 = 0.5; chi2 < 1e6; chi2 *= 1.37) {
        const double h = 1e-6 * chi2;
        const double slope = (huber_cost(chi2 + h, kThreshold) - huber_cost(chi2 - h, kThreshold)) / (2 * h);
        EXPECT_NEAR(slope, huber_weight(chi2, kThreshold), 1e-5);
    }
    EXPECT_NEAR(huber_cost(kThreshold * (1 + 1e-12), kThreshold), kThreshold, 1e-9);
}

// Promise: a point at or behind the camera, or with coordinates beyond all measure, is far; nothing is NaN.
TEST(Linearisation, WhatCannotBeSeenIsFar) {
    Sighting seen;
    seen.info = seen.info_z = 1e6;
    const CameraRows camera;
    for (const double z : {-1e300, -1.0, 0.0, 0.049, 1e300, std::nan("")}) {
        for (const double x : {-1e308, 0.0, 1.0, 1e308, std::nan("")}) {
            const double p[3] = {x, 1.0, z};
            const SightingResidual r = sighting_residual(camera, p, seen);
            EXPECT_TRUE(r.is_far());
            EXPECT_EQ(r.chi2, kAdjustChi2Far);
        }
    }
}

}  // namespace
}  // namespace stillmesh::linearisation_test
