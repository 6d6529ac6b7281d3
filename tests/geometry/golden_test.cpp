// One number over everything geometry computes: seen equal from gcc 12 (-O0, -O2, -O3 with FMA at hand) and clang 14 on
// x86-64, and from gcc on arm64 and armhf. Whoever changes a formula changes the number, and says so in the commit.
#include <gtest/gtest.h>

#include <cstdint>
#include <vector>

#include "engine/base/hash.hpp"
#include "engine/base/numbers.hpp"
#include "engine/base/random.hpp"
#include "engine/geometry/camera.hpp"
#include "engine/geometry/depth_noise.hpp"
#include "engine/geometry/se3.hpp"
#include "engine/geometry/trig.hpp"

namespace stillmesh::golden_test {
namespace {

// Promise: geometry gives the same bits on every processor, compiler and optimisation level.
TEST(Geometry, GoldenBits) {
    Random random(1);  // one draw a statement: arguments have no order of evaluation
    StateHash hash;
    const CameraModel model{640,      480,       517.306408, 516.469215, 318.643040, 255.313989,
                            0.262383, -0.953104, -0.005358,  0.002628,   1.163314};
    for (int i = 0; i < 20'000; ++i) {
        Vector6 xi;
        for (int k = 0; k < 6; ++k) xi[k] = random.uniform(-2, 2);
        SE3 motion = se3_exp(xi);
        const Vector6 twice = se3_log(motion * motion);
        for (int k = 0; k < 6; ++k) hash.add(twice[k]);
        const Vector4 q = quaternion_from_rotation(motion.rotation);
        for (int k = 0; k < 4; ++k) hash.add(q[k]);
        renormalise(motion.rotation);
        hash.add(motion.rotation(1, 2));

        const double u = random.uniform(0, 639);
        const double v = random.uniform(0, 479);
        const Vector2 n = undistort_to_normalised(model, {u, v});
        hash.add(n.x());
        hash.add(n.y());
        hash.add(round_clamped(random.uniform(-5e9, 5e9)));
        hash.add(arc_tan2(n.x(), n.y()));
        hash.add(sin_cos(u).sin);
    }
    EXPECT_EQ(hash.value(), 0x2bb277b31d3ae9b2ULL) << std::hex << hash.value();
}

// A lens of each kind, with coefficients that mostly, not always, are those of one.
CameraModel some_lens(std::uint32_t kind, Random& random) {
    CameraModel out;
    out.width = 64 + random.below(30);
    out.height = 40 + random.below(30);
    out.fx = random.uniform(30, 90);
    out.fy = out.fx * random.uniform(0.9, 1.1);
    out.cx = out.width * random.uniform(0.45, 0.55);
    out.cy = out.height * random.uniform(0.45, 0.55);
    if (kind == 0) return out;
    for (double* const k : {&out.k1, &out.k2, &out.k3}) *k = random.uniform(-0.1, 0.1);
    if (kind == 3) {
        out.lens = Lens::kFisheye;
        out.k4 = random.uniform(-0.01, 0.01);
        return out;
    }
    for (double* const k : {&out.p1, &out.p2}) *k = random.uniform(-0.01, 0.01);
    if (kind == 1) return out;
    for (double* const k : {&out.k4, &out.k5, &out.k6}) *k = random.uniform(-0.05, 0.1);
    return out;
}

// Promise: so do lenses of every kind, in the picture and far around it: which are lenses, and what they see where.
TEST(Camera, GoldenBits) {
    Random random(2);
    StateHash hash;
    std::uint32_t lenses = 0, seen = 0, bent_back = 0;
    for (std::uint32_t i = 0; i < 160; ++i) {
        const CameraModel model = some_lens(i % 4, random);
        const Status status = validate(model);
        hash.add(static_cast<std::uint32_t>(status));
        if (status != Status::kOk) continue;
        ++lenses;
        hash.add(view_cosine(model));
        for (std::uint32_t k = 0; k < 200; ++k) {
            Vector3 q;
            const double reach = k % 2 == 0 ? 1.0 : 4.0;
            for (int axis = 0; axis < 2; ++axis) q(axis) = random.uniform(-reach, reach);
            q.z() = random.uniform(0.1, 2);
            Vector2 pixel = Vector2::Zero();
            const bool is_projected = project(model, q, 0.3, pixel);
            hash.add(is_projected ? 1U : 0U);
            bent_back += is_projected ? 0U : 1U;
            if (!is_projected) continue;
            ++seen;
            hash.add(pixel.x());
            hash.add(pixel.y());
            const Vector2 back = undistort_to_normalised(model, pixel);
            hash.add(back.x());
            hash.add(back.y());
            hash.add(distort_to_pixel(model, back * 1.3).x());
        }
    }
    EXPECT_GT(lenses, 100U);
    EXPECT_GT(seen, 5000U);
    EXPECT_GT(bent_back, 1000U);
    EXPECT_EQ(hash.value(), 0x5ab26fac6029b6a1ULL) << std::hex << hash.value();
}

// Promise: so do rotations near nothing and near half a turn, what is derived from them, and depth of a patch of
// pixels.
TEST(SE3, GoldenBits) {
    Random random(3);
    StateHash hash;
    std::vector<std::uint16_t> pixels(12 * 9);
    std::uint32_t valid = 0;
    for (std::uint32_t i = 0; i < 3000; ++i) {
        constexpr double kSizes[] = {1e-9, 1e-5, 1e-3, 0.1, 1.0, 3.1, 3.1415, 4.0};
        Vector6 xi;
        for (int k = 0; k < 6; ++k) xi(k) = random.uniform(-1, 1);
        xi.tail<3>() *= kSizes[i % 8] / xi.tail<3>().norm();
        const SE3 motion = se3_exp(xi);
        const Matrix6 adjoint = se3_adjoint(motion);
        for (int k = 0; k < 36; ++k) hash.add(adjoint(k / 6, k % 6));
        const Vector3 log = so3_log(motion.rotation);
        const Matrix3 derivative = so3_log_derivative(log);
        for (int k = 0; k < 9; ++k) hash.add(derivative(k / 3, k % 3));
        const Vector3 moved = moved_a_little(xi * 0.05, Vector3(xi(0), xi(1), 2));
        for (int k = 0; k < 3; ++k) hash.add(moved(k) + log(k));
        hash.add(rotation_angle(motion.rotation));
        Matrix3 off = motion.rotation;
        const auto row = static_cast<int>(random.below(3));
        const auto column = static_cast<int>(random.below(3));
        off(row, column) += kSizes[i % 3];
        hash.add(is_rotation(off) ? 1U : 0U);
        const Vector6 whole = se3_log(motion);
        for (int k = 0; k < 6; ++k) hash.add(whole(k));
        const RigidTransform transform = transform_of(motion);
        const SE3 again = pose_of(transform);
        for (int k = 0; k < 9; ++k) hash.add(again.rotation(k / 3, k % 3));

        const std::uint32_t level = 500 + random.below(6000);
        for (std::uint16_t& pixel : pixels) {
            const std::uint32_t step = random.below(12);
            pixel = static_cast<std::uint16_t>(step == 0 ? 0 : level + 2 * random.below(1 + 100 * (i % 3)));
        }
        const auto x = static_cast<std::int32_t>(random.below(14)) - 1;
        const auto y = static_cast<std::int32_t>(random.below(11)) - 1;
        const DepthSample sample = sample_depth({pixels.data(), 12, 9, 12}, 0.001, x, y, DepthParameters{});
        hash.add(sample.mean_m);
        hash.add(sample.variance_m2);
        valid += sample.is_valid() ? 1U : 0U;
    }
    EXPECT_GT(valid, 1000U);
    EXPECT_LT(valid, 2800U);
    EXPECT_EQ(hash.value(), 0xcd19685dd35ca90cULL) << std::hex << hash.value();
}

}  // namespace
}  // namespace stillmesh::golden_test
