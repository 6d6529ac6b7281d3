// The two questions a Delaunay triangulation asks of points, answered exactly in integers: which side of a line, and
// inside which circle. Limit: coordinates in [0, kMeshCoordinateMax]; cost: 2 and 10 multiplications. method.md 3.
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

// How a segment a, b is seen from a point: twice the area of the triangle, and the scalar product of the two arms.
// arms / area is the cotangent of the angle at the point, so comparing two by it says which of them the growing circle
// through a and b meets first. Both are sums of two products < 2^28: int32 is exact.
struct Sight {
    PixelPoint from;
    std::int32_t area = 0;
    std::int32_t arms = 0;
};
[[nodiscard]] constexpr Sight sight(PixelPoint a, PixelPoint b, PixelPoint p) noexcept {
    const std::int32_t ax = p.x - a.x, ay = p.y - a.y;
    return {p, (b.x - a.x) * ay - (b.y - a.y) * ax, ax * (p.x - b.x) + ay * (p.y - b.y)};
}

// For a counter-clockwise a, b, c it is positive when d is inside their circle, 0: on it. It equals the lifted 4 x 4
// determinant: with r, c, d relative to a, that is c^2 (r x d) - r^2 (c x d) - d^2 (r x c), and for any vectors of the
// plane r^2 (c x d) = (c . r)(r x d) - (d . r)(r x c). Two products of numbers < 2^29: below 2^59, int64 is exact.
[[nodiscard]] constexpr std::int64_t circle_determinant(const Sight& of_c, const Sight& of_d) noexcept {
    return static_cast<std::int64_t>(of_c.arms) * of_d.area - static_cast<std::int64_t>(of_d.arms) * of_c.area;
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

// Is d inside the circle a, b, c (counter-clockwise)? Without ties: what the triangulation is built on.
[[nodiscard]] constexpr bool is_inside(PixelPoint a, PixelPoint b, const Sight& c, const Sight& d) noexcept {
    const std::int64_t determinant = circle_determinant(c, d);
    if (determinant != 0) [[likely]]
        return determinant > 0;
    return is_inside_by_rule(a, b, c.from, d.from);
}

}  // namespace stillmesh
