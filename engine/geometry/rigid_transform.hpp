// A pose as programs see it: plain data, and the arithmetic that programs and cameras need of it. No library; a unit
// quaternion stays one to 1e-15 a product, and is not normalised again.
#pragma once

#include <array>
#include <cmath>

namespace stillmesh {

struct RigidTransform {
    double rotation_xyzw[4] = {0, 0, 0, 1};  // unit quaternion
    double translation_m[3] = {0, 0, 0};
};

// A direction of frame b in frame a.
[[nodiscard]] inline std::array<double, 3> rotated(const RigidTransform& a_from_b,
                                                   const std::array<double, 3>& p) noexcept {
    const double(&q)[4] = a_from_b.rotation_xyzw;
    // p + 2 w (u x p) + 2 u x (u x p)
    const double c[3] = {q[1] * p[2] - q[2] * p[1], q[2] * p[0] - q[0] * p[2], q[0] * p[1] - q[1] * p[0]};
    const double d[3] = {q[1] * c[2] - q[2] * c[1], q[2] * c[0] - q[0] * c[2], q[0] * c[1] - q[1] * c[0]};
    return {p[0] + 2 * (q[3] * c[0] + d[0]), p[1] + 2 * (q[3] * c[1] + d[1]), p[2] + 2 * (q[3] * c[2] + d[2])};
}

// A point of frame b in frame a.
[[nodiscard]] inline std::array<double, 3> transformed(const RigidTransform& a_from_b,
                                                       const std::array<double, 3>& p) noexcept {
    const std::array<double, 3> turned = rotated(a_from_b, p);
    const double(&t)[3] = a_from_b.translation_m;
    return {turned[0] + t[0], turned[1] + t[1], turned[2] + t[2]};
}

// a_from_b * b_from_c = a_from_c.
[[nodiscard]] inline RigidTransform compose(const RigidTransform& a_from_b, const RigidTransform& b_from_c) noexcept {
    const double(&a)[4] = a_from_b.rotation_xyzw;
    const double(&b)[4] = b_from_c.rotation_xyzw;
    const double(&t)[3] = b_from_c.translation_m;
    const std::array<double, 3> moved = transformed(a_from_b, {t[0], t[1], t[2]});
    return {
        {a[3] * b[0] + a[0] * b[3] + a[1] * b[2] - a[2] * b[1], a[3] * b[1] + a[1] * b[3] + a[2] * b[0] - a[0] * b[2],
         a[3] * b[2] + a[2] * b[3] + a[0] * b[1] - a[1] * b[0], a[3] * b[3] - a[0] * b[0] - a[1] * b[1] - a[2] * b[2]},
        {moved[0], moved[1], moved[2]}};
}

[[nodiscard]] inline RigidTransform inverse_of(const RigidTransform& a_from_b) noexcept {
    const double(&q)[4] = a_from_b.rotation_xyzw;
    const double(&t)[3] = a_from_b.translation_m;
    const RigidTransform turned{{-q[0], -q[1], -q[2], q[3]}, {0, 0, 0}};
    const std::array<double, 3> moved = rotated(turned, {t[0], t[1], t[2]});
    return {{-q[0], -q[1], -q[2], q[3]}, {-moved[0], -moved[1], -moved[2]}};
}

// Row by row.
using RotationMatrix = std::array<double, 9>;

[[nodiscard]] inline RotationMatrix matrix_of(const double (&xyzw)[4]) noexcept {
    const auto [x, y, z, w] = xyzw;
    return {1 - 2 * (y * y + z * z), 2 * (x * y - z * w),     2 * (x * z + y * w),
            2 * (x * y + z * w),     1 - 2 * (x * x + z * z), 2 * (y * z - x * w),
            2 * (x * z - y * w),     2 * (y * z + x * w),     1 - 2 * (x * x + y * y)};
}

// Within `tolerance` in each product of two rows; a mirror and what is not finite are none.
[[nodiscard]] inline bool is_rotation(const RotationMatrix& r, double tolerance) noexcept {
    for (std::size_t i = 0; i < 3; ++i) {
        for (std::size_t j = i; j < 3; ++j) {
            double product = i == j ? -1 : 0;
            for (std::size_t k = 0; k < 3; ++k) product += r[3 * i + k] * r[3 * j + k];
            if (!(std::abs(product) < tolerance)) return false;
        }
    }
    return r[0] * (r[4] * r[8] - r[5] * r[7]) - r[1] * (r[3] * r[8] - r[5] * r[6]) +
               r[2] * (r[3] * r[7] - r[4] * r[6]) >
           0;
}

// Of a rotation; w >= 0. By the largest of the four: the roots of small ones are inexact.
inline void write_quaternion(const RotationMatrix& r, double (&xyzw)[4]) noexcept {
    const double rows[4][4] = {{1 + r[0] - r[4] - r[8], r[1] + r[3], r[2] + r[6], r[7] - r[5]},
                               {r[1] + r[3], 1 - r[0] + r[4] - r[8], r[5] + r[7], r[2] - r[6]},
                               {r[2] + r[6], r[5] + r[7], 1 - r[0] - r[4] + r[8], r[3] - r[1]},
                               {r[7] - r[5], r[2] - r[6], r[3] - r[1], 1 + r[0] + r[4] + r[8]}};
    std::size_t largest = 0;
    for (std::size_t i = 1; i < 4; ++i) largest = rows[i][i] > rows[largest][largest] ? i : largest;
    double norm = 0;
    for (const double value : rows[largest]) norm += value * value;
    const double scale = (rows[largest][3] < 0 ? -1 : 1) / std::sqrt(norm);
    for (std::size_t i = 0; i < 4; ++i) xyzw[i] = scale * rows[largest][i];
}

}  // namespace stillmesh
