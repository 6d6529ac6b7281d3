#include "engine/static_region/distance_consistency.hpp"

#include <gtest/gtest.h>

#include <cmath>
#include <cstdint>

#include "tests/support/synthetic.hpp"

namespace stillmesh::distance_consistency_test {
namespace {

using test::Noise;

// The variance of the edge's length now, by differentiating the measurement (two normalised coordinates and a depth at
// either end) numerically.
double variance_now(const Correspondence& a, const Correspondence& b) {
    const auto point = [](const Vector3& m) { return Vector3(m.x() * m.z(), m.y() * m.z(), m.z()); };
    const Vector3 measured[2] = {{a.normalised.x(), a.normalised.y(), a.p_camera.z()},
                                 {b.normalised.x(), b.normalised.y(), b.p_camera.z()}};
    const double variances[2][3] = {{a.var_pixel, a.var_pixel, a.var_z}, {b.var_pixel, b.var_pixel, b.var_z}};
    double variance = 0;
    for (int end = 0; end < 2; ++end) {
        for (int k = 0; k < 3; ++k) {
            constexpr double kStep = 1e-6;
            Vector3 plus[2] = {measured[0], measured[1]};
            Vector3 minus[2] = {measured[0], measured[1]};
            plus[end](k) += kStep;
            minus[end](k) -= kStep;
            const double slope =
                ((point(plus[0]) - point(plus[1])).norm() - (point(minus[0]) - point(minus[1])).norm()) / (2 * kStep);
            variance += slope * slope * variances[end][k];
        }
    }
    return variance;
}

// The same for the map's points, whose uncertainty lies along the ray and across it.
double variance_then(const Correspondence& a, const Correspondence& b, const Matrix3& world_from_camera) {
    const Correspondence* const ends[2] = {&a, &b};
    double variance = 0;
    for (int end = 0; end < 2; ++end) {
        const Vector3 directions[3] = {{1, 0, 0}, {0, 1, 0}, {ends[end]->normalised.x(), ends[end]->normalised.y(), 1}};
        for (int k = 0; k < 3; ++k) {
            constexpr double kStep = 1e-6;
            const Vector3 step = world_from_camera * directions[k] * kStep * (end == 0 ? 1.0 : -1.0);
            const Vector3 edge = a.p_world - b.p_world;
            const double slope = ((edge + step).norm() - (edge - step).norm()) / (2 * kStep);
            variance += slope * slope * (k == 2 ? ends[end]->map_var_z : ends[end]->map_var_lateral);
        }
    }
    return variance;
}

// Promise: the variance along a direction is e^T Sigma e with Sigma = var_z r r^T + lateral diag(1, 1, 0) (method.md
// 1).
TEST(DistanceConsistency, VarianceAlongIsTheQuadraticForm) {
    Random random(1);
    for (int round = 0; round < 1000; ++round) {
        const Vector3 e = test::random_vector(random, 1.0).normalized();
        const Vector2 ray(random.uniform(-0.6, 0.6), random.uniform(-0.5, 0.5));
        const Vector3 r(ray.x(), ray.y(), 1.0);
        const double var_z = random.uniform(0, 1e-3), lateral = random.uniform(0, 1e-4);
        Matrix3 sigma = var_z * (r * r.transpose());
        sigma(0, 0) += lateral;
        sigma(1, 1) += lateral;
        EXPECT_NEAR(variance_along(e, ray, var_z, lateral), e.dot(sigma * e), 1e-16);
    }
}

// Promise: an edge is cut exactly where its change exceeds the deviation that numerical propagation of all noise gives
// (method.md 4), in both directions, with floor and lag.
TEST(DistanceConsistency, CutsWhereNumericalPropagationSays) {
    Random random(2);
    for (int round = 0; round < 2000; ++round) {
        const SE3 pose = test::random_motion(random, 1.0, 0.8);
        const Noise noise{random.uniform(5e-4, 3e-3), random.uniform(5e-4, 3e-3), random.uniform(5e-4, 5e-3)};
        const Vector3 p = test::random_point_in_view(random), q = test::random_point_in_view(random);
        auto a = test::measure(p, pose * p, noise, random);
        auto b = test::measure(q, pose * q, noise, random);
        b.map_var_z *= 3;
        if ((a.p_camera - b.p_camera).norm() < 0.05) continue;
        EdgeTest test;
        test.change_max_m = 10;
        test.floor_m = round % 2 == 0 ? 0.0 : 0.005;
        test.lag_angle_rad = round % 3 == 0 ? 0.01 : 0.0;
        test.camera_from_world_rotation = pose.rotation.transpose();
        const double za = a.p_camera.z(), zb = b.p_camera.z();
        const double lag2 = test.lag_angle_rad * test.lag_angle_rad;
        const double variance = variance_now(a, b) + variance_then(a, b, pose.rotation) + test.floor_m * test.floor_m +
                                lag2 * 0.5 * (za * za + zb * zb);
        const double limit = std::sqrt(test.chi2_max * variance);
        const double now = (a.p_camera - b.p_camera).norm();
        const Vector3 along = (b.p_world - a.p_world).normalized();
        for (const double factor : {-1.001, -0.999, 0.0, 0.999, 1.001}) {
            if (now + factor * limit < 0.03) continue;
            Correspondence moved = b;
            moved.p_world = a.p_world + along * (now + factor * limit);
            EXPECT_EQ(keeps_distance(a, moved, test), std::abs(factor) < 1) << factor << " round " << round;
            EXPECT_EQ(keeps_distance(moved, a, test), std::abs(factor) < 1) << "from the other end";
        }
    }
}

// Promise: whatever the noise, a change beyond tau cuts (paper: Algorithm 1).
TEST(DistanceConsistency, TauCutsWhateverTheNoise) {
    Random random(3);
    const auto at = [&](double x) {
        const Vector3 p(x, 0, 2);
        auto c = test::measure(p, p, Noise{}, random);
        c.var_z = c.map_var_z = c.map_var_lateral = c.var_pixel = 100;
        return c;
    };
    const EdgeTest test;
    for (const double change : {0.0999, -0.0999, 0.1001, -0.1001}) {
        const auto a = at(0);
        auto b = at(0.5);
        b.p_world.x() += change;
        EXPECT_EQ(keeps_distance(a, b, test), std::abs(change) < 0.1) << change;
    }
    auto nowhere = at(0.5);
    nowhere.p_world.x() = std::nan("");
    EXPECT_FALSE(keeps_distance(at(0), nowhere, test));
}

// Promise: edges shorter than a centimetre, down to nothing, are judged without a direction: no NaN, small changes pass
// and large ones do not.
TEST(DistanceConsistency, ShortEdgesHaveNoDirection) {
    Random random(4);
    for (const double length : {0.0, 1e-9, 1e-3, 9e-3}) {
        const Vector3 p(0.3, 0.2, 2.0), q = p + Vector3(length, 0, 0);
        const auto a = test::measure(p, p, Noise{}, random);
        auto b = test::measure(q, q, Noise{}, random);
        EXPECT_TRUE(keeps_distance(a, b, EdgeTest{})) << length;
        b.p_world.y() += 0.05;
        EXPECT_FALSE(keeps_distance(a, b, EdgeTest{})) << length;
        const double variance = 25e-6 + (a.var_z + a.map_var_z + b.var_z + b.map_var_z) / 3 +
                                (a.var_pixel * 4 + b.var_pixel * 4 + a.map_var_lateral + b.map_var_lateral) * 2 / 3;
        for (const double factor : {0.99, 1.01}) {
            b.p_world = a.p_world + Vector3(length + factor * std::sqrt(6.63 * variance), 0, 0);
            EXPECT_EQ(keeps_distance(a, b, EdgeTest{}), factor < 1) << length;
        }
    }
}

// Promise: of edges between points that stand still, 1 in 100 is cut at chi2 6.63, at every distance and direction.
TEST(DistanceConsistency, CutsOneInAHundredOfStillEdges) {
    for (const double z_m : {0.8, 1.5, 3.0}) {
        Random random(5);
        EdgeTest test;
        test.floor_m = 0;
        test.change_max_m = 10;
        int cut = 0, all = 0;
        for (int round = 0; round < 40'000; ++round) {
            const SE3 pose = test::random_motion(random, 1.0, 0.8);
            const Noise noise{1.5e-3, 1.425e-3, 0};
            const Vector3 p = test::random_point_in_view(random, z_m, 1.3 * z_m);
            const Vector3 q = test::random_point_in_view(random, z_m, 1.3 * z_m);
            if ((p - q).norm() < 0.1) continue;
            auto a = test::measure(p, pose * p, noise, random), b = test::measure(q, pose * q, noise, random);
            a.map_var_z = a.map_var_lateral = b.map_var_z = b.map_var_lateral = 0;
            test.camera_from_world_rotation = pose.rotation.transpose();
            ++all;
            cut += keeps_distance(a, b, test) ? 0 : 1;
        }
        EXPECT_NEAR(static_cast<double>(cut) / all, 0.01, 0.003) << z_m;
    }
}

}  // namespace
}  // namespace stillmesh::distance_consistency_test
