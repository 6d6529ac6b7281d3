// The damped 3x3 Hessian of one point, its lower triangle by rows in six numbers, and its Cholesky factor L in the same
// place with the diagonal inverted: what eliminating a point from an adjustment takes. Inline: innermost loops.
#pragma once

#include <cmath>

#include "engine/adjust/descent.hpp"

namespace stillmesh {

// Where the diagonal is.
inline constexpr int kPointDiagonal[3] = {0, 2, 5};

// False: the point cannot be placed.
[[nodiscard]] inline bool factor_point(const double v[6], double l[6]) noexcept {
    const double p0 = v[0];
    if (!(p0 > 0.0 && p0 < kPivotHuge)) return false;
    l[0] = 1.0 / std::sqrt(p0);
    l[1] = v[1] * l[0];
    const double p1 = v[2] - l[1] * l[1];
    if (!(p1 > kPivotRounding * v[2] && p1 < kPivotHuge)) return false;
    l[2] = 1.0 / std::sqrt(p1);
    l[3] = v[3] * l[0];
    l[4] = (v[4] - l[3] * l[1]) * l[2];
    const double p2 = v[5] - l[3] * l[3] - l[4] * l[4];
    if (!(p2 > kPivotRounding * v[5] && p2 < kPivotHuge)) return false;
    l[5] = 1.0 / std::sqrt(p2);
    return true;
}

// L^-1 x and L^-T x, in place.
inline void forward(const double l[6], double x[3]) noexcept {
    x[0] = x[0] * l[0];
    x[1] = (x[1] - l[1] * x[0]) * l[2];
    x[2] = (x[2] - l[3] * x[0] - l[4] * x[1]) * l[5];
}
inline void backward(const double l[6], double x[3]) noexcept {
    x[2] = x[2] * l[5];
    x[1] = (x[1] - l[4] * x[2]) * l[2];
    x[0] = (x[0] - l[1] * x[1] - l[3] * x[2]) * l[0];
}

}  // namespace stillmesh
