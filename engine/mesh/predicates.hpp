// The two questions a Delaunay triangulation asks of points, answered exactly in integers: which side of a line, and
// inside which circle. Limit: coordinates in [0, kMeshCoordinateMax]; cost: 2 and 15 multiplications. method.md 3.
#pragma once

#include <cstdint>

#include "engine/mesh/pixel_point.hpp"

namespace stillmesh {

// Twice the signed area of a, b, c: positive when they turn counter-clockwise (x right, y up). Differences are < 2^14,
// so each product is < 2^28 and the result < 2^29: int32 is exact.
[[nodiscard]] constexpr std::int32_t twice_area(PixelPoint a, PixelPoint b, PixelPoint c) noexcept {
    return (b.x - a.x) * (c.y - a.y) - (b.y - a.y) * (c.x - a.x);
}

// +1: a, b, c turn counter-clockwise, 0: on one line, -1: clockwise.
[[nodiscard]] constexpr int orient2d(PixelPoint a, PixelPoint b, PixelPoint c) noexcept {
    const std::int32_t area = twice_area(a, b, c);
    return (area > 0) - (area < 0);
}

// The lifted determinant of a, b, c, d: for a counter-clockwise a, b, c it is positive when d is inside their circle.
// Differences are < 2^14, a squared length < 2^29, a cross product < 2^29 (int32 is exact for both, which spares
// 32-bit processors most of the 64-bit products); three products stay below 3 * 2^58 < 2^60: int64 is exact.
[[nodiscard]] constexpr std::int64_t circle_determinant(PixelPoint a, PixelPoint b, PixelPoint c,
                                                        PixelPoint d) noexcept {
    const std::int32_t ax = a.x - d.x, ay = a.y - d.y;
    const std::int32_t bx = b.x - d.x, by = b.y - d.y;
    const std::int32_t cx = c.x - d.x, cy = c.y - d.y;
    const std::int64_t lift_a = ax * ax + ay * ay;
    const std::int64_t lift_b = bx * bx + by * by;
    const std::int64_t lift_c = cx * cx + cy * cy;
    return lift_a * (bx * cy - by * cx) + lift_b * (cx * ay - cy * ax) + lift_c * (ax * by - ay * bx);
}

// +1: d inside the circle a, b, c (counter-clockwise), 0: on it, -1: outside.
[[nodiscard]] constexpr int in_circle(PixelPoint a, PixelPoint b, PixelPoint c, PixelPoint d) noexcept {
    const std::int64_t determinant = circle_determinant(a, b, c, d);
    return (determinant > 0) - (determinant < 0);
}

// The order that breaks ties: by x, then by y.
[[nodiscard]] constexpr bool is_before(PixelPoint a, PixelPoint b) noexcept {
    return a.x != b.x ? a.x < b.x : a.y < b.y;
}

// Four points on one circle: is d inside a, b, c (counter-clockwise) once the first of the four, by is_before, is
// pushed inward by an infinitesimal amount? False when d is one of the others. See delaunay.cpp for what this decides.
[[nodiscard]] constexpr bool is_inside_by_rule(PixelPoint a, PixelPoint b, PixelPoint c, PixelPoint d) noexcept {
    if (d == a || d == b || d == c) return false;
    if (is_before(d, a) && is_before(d, b) && is_before(d, c)) return true;
    const PixelPoint ab = is_before(a, b) ? a : b;
    const PixelPoint first = is_before(ab, c) ? ab : c;
    // Lowering a's lift by epsilon adds -epsilon * twice_area(b, c, d) to the determinant, likewise for b and c.
    const int facing = first == a ? orient2d(b, c, d) : first == b ? orient2d(c, a, d) : orient2d(a, b, d);
    return facing < 0;
}

// in_circle without ties: the predicate the triangulation is built on.
[[nodiscard]] constexpr bool is_inside(PixelPoint a, PixelPoint b, PixelPoint c, PixelPoint d) noexcept {
    const std::int64_t determinant = circle_determinant(a, b, c, d);
    if (determinant != 0) [[likely]]
        return determinant > 0;
    return is_inside_by_rule(a, b, c, d);
}

}  // namespace stillmesh
