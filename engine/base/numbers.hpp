// From floating point to whole numbers, always clamped: a conversion that overflows is undefined in C++ and differs
// between x86 and ARM. NaN becomes the lower bound. No libm call at any optimisation level.
#pragma once

#include <cstdint>

namespace stillmesh {

[[nodiscard]] constexpr bool is_finite(double x) noexcept {
    return x - x == 0.0;
}

namespace numbers_detail {

// Largest whole number not above `value`, which must be inside int64 (the callers clamp first).
[[nodiscard]] constexpr std::int64_t floor_inside(double value) noexcept {
    const auto whole = static_cast<std::int64_t>(value);
    return value < static_cast<double>(whole) ? whole - 1 : whole;
}

// The nearest whole number, halves away from zero. value - whole is exact (Sterbenz), so unlike floor(value + 0.5) the
// largest number below 0.5 goes to 0.
[[nodiscard]] constexpr std::int64_t round_inside(double value) noexcept {
    const auto whole = static_cast<std::int64_t>(value);
    const double rest = value - static_cast<double>(whole);
    return rest >= 0.5 ? whole + 1 : (rest <= -0.5 ? whole - 1 : whole);
}

}  // namespace numbers_detail

// Nearest whole number in [low, high], halves away from zero: round_clamped(2.5, ..) = 3, (-2.5, ..) = -3.
[[nodiscard]] constexpr std::int32_t round_clamped(double value, std::int32_t low = INT32_MIN,
                                                   std::int32_t high = INT32_MAX) noexcept {
    if (!(value > static_cast<double>(low))) return low;  // NaN too
    if (value >= static_cast<double>(high)) return high;
    return static_cast<std::int32_t>(numbers_detail::round_inside(value));
}

// Largest whole number not above `value`, in [low, high]: floor_clamped(-0.5, ..) = -1.
[[nodiscard]] constexpr std::int32_t floor_clamped(double value, std::int32_t low = INT32_MIN,
                                                   std::int32_t high = INT32_MAX) noexcept {
    if (!(value > static_cast<double>(low))) return low;
    if (value >= static_cast<double>(high)) return high;
    return static_cast<std::int32_t>(numbers_detail::floor_inside(value));
}

// The same for 64 bits (times in ns, seeds). Doubles beyond 2^53 have no fraction; the bounds are compared as doubles,
// and 2^63 as a double lies beyond INT64_MAX, so the comparison keeps the cast defined.
[[nodiscard]] constexpr std::int64_t round_clamped_64(double value, std::int64_t low = INT64_MIN,
                                                      std::int64_t high = INT64_MAX) noexcept {
    if (!(value > static_cast<double>(low))) return low;
    if (value >= static_cast<double>(high)) return high;
    return numbers_detail::round_inside(value);
}

}  // namespace stillmesh
