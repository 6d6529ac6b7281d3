// Own sin, cos and atan2, at most 4 ulp off and the same bits on every processor and compiler: libm differs
// between processors. Only + - * / sqrt inside.
#pragma once

namespace stillmesh {

// Horner's rule, the coefficient of the highest power first: written out at compile time.
template <typename... Coefficients>
[[nodiscard]] constexpr double polynomial(double x, double highest, Coefficients... lower) noexcept {
    ((highest = highest * x + lower), ...);
    return highest;
}

struct SinCos {
    double sin;
    double cos;
};

// |angle| <= 1e5 rad; larger or non-finite input is our bug (CHECK).
[[nodiscard]] SinCos sin_cos(double angle_rad) noexcept;
// In (-pi, pi]; atan2(0, 0) = 0.
[[nodiscard]] double arc_tan2(double y, double x) noexcept;

}  // namespace stillmesh
