#include "platform/library/transform.hpp"

#include <gtest/gtest.h>

#include <cmath>
#include <random>

namespace stillmesh::transform_test {
namespace {

using Matrix = std::array<std::array<double, 4>, 4>;

// The textbook's matrix of a quaternion and a translation: another way to the same numbers.
[[nodiscard]] Matrix matrix_of(const RigidTransform& transform) {
    const auto [x, y, z, w] = transform.rotation_xyzw;
    const auto& t = transform.translation_m;
    return {{{1 - 2 * (y * y + z * z), 2 * (x * y - z * w), 2 * (x * z + y * w), t[0]},
             {2 * (x * y + z * w), 1 - 2 * (x * x + z * z), 2 * (y * z - x * w), t[1]},
             {2 * (x * z - y * w), 2 * (y * z + x * w), 1 - 2 * (x * x + y * y), t[2]},
             {0, 0, 0, 1}}};
}
[[nodiscard]] Matrix product(const Matrix& a, const Matrix& b) {
    Matrix out{};
    for (std::size_t i = 0; i < 4; ++i)
        for (std::size_t j = 0; j < 4; ++j)
            for (std::size_t k = 0; k < 4; ++k) out[i][j] += a[i][k] * b[k][j];
    return out;
}
void expect_near(const Matrix& a, const Matrix& b) {
    for (std::size_t i = 0; i < 4; ++i)
        for (std::size_t j = 0; j < 4; ++j) EXPECT_NEAR(a[i][j], b[i][j], 1e-12) << i << ' ' << j;
}
[[nodiscard]] RigidTransform any(std::mt19937& random) {
    std::normal_distribution<double> normal;
    RigidTransform out;
    double length = 0;
    for (double& q : out.rotation_xyzw) {
        q = normal(random);
        length += q * q;
    }
    for (double& q : out.rotation_xyzw) q /= std::sqrt(length);
    for (double& t : out.translation_m) t = 3 * normal(random);
    return out;
}

// Promise: composition, inverse and application are those of 4x4 matrices.
TEST(Transform, IsWhatMatricesSay) {
    std::mt19937 random(7);
    for (int i = 0; i < 100; ++i) {
        const RigidTransform a = any(random), b = any(random);
        expect_near(matrix_of(compose(a, b)), product(matrix_of(a), matrix_of(b)));
        expect_near(matrix_of(compose(a, inverse_of(a))), matrix_of(RigidTransform{}));
        const std::array<double, 3> point = {1, -2, 3}, moved = transformed(a, point);
        const Matrix m = matrix_of(a);
        for (std::size_t k = 0; k < 3; ++k)
            EXPECT_NEAR(moved[k], m[k][0] * point[0] + m[k][1] * point[1] + m[k][2] * point[2] + m[k][3], 1e-12);
        PoseEstimate pose;
        pose.map_from_odom = a;
        pose.odom_from_camera = b;
        expect_near(matrix_of(map_from_camera(pose)), product(matrix_of(a), matrix_of(b)));
    }
}

}  // namespace
}  // namespace stillmesh::transform_test
