#include "engine/mesh/predicates.hpp"

#include <gtest/gtest.h>

#include <array>
#include <cstdint>

#include "engine/base/random.hpp"
#include "tests/mesh/mesh_checker.hpp"

namespace stillmesh::predicates_test {
namespace {

using mesh_checker::area2;
using mesh_checker::circle;
using mesh_checker::point_of;
using mesh_checker::sign;
using mesh_checker::Wide;

// The lifted determinant relative to d, in 128 bits.
Wide lifted(PixelPoint a, PixelPoint b, PixelPoint c, PixelPoint d) {
    const auto x = [&](PixelPoint p) { return Wide(p.x) - d.x; };
    const auto y = [&](PixelPoint p) { return Wide(p.y) - d.y; };
    const auto lift = [&](PixelPoint p) { return x(p) * x(p) + y(p) * y(p); };
    return lift(a) * (x(b) * y(c) - y(b) * x(c)) + lift(b) * (x(c) * y(a) - y(c) * x(a)) +
           lift(c) * (x(a) * y(b) - y(a) * x(b));
}

// +1: inside the circle a, b, c, 0: on it, -1: outside.
int in_circle(PixelPoint a, PixelPoint b, PixelPoint c, PixelPoint d) {
    return sign(circle_determinant(sight(a, b, c), sight(a, b, d)));
}
bool is_inside(PixelPoint a, PixelPoint b, PixelPoint c, PixelPoint d) {
    return is_inside(a, b, sight(a, b, c), sight(a, b, d));
}

void expect_exact(PixelPoint a, PixelPoint b, PixelPoint c, PixelPoint d) {
    ASSERT_EQ(Wide(twice_area(a, b, c)), area2(point_of(a), point_of(b), point_of(c)));
    ASSERT_EQ(orient2d(a, b, c), sign(area2(point_of(a), point_of(b), point_of(c))));
    ASSERT_TRUE(Wide(circle_determinant(sight(a, b, c), sight(a, b, d))) == lifted(a, b, c, d));
    ASSERT_EQ(in_circle(a, b, c, d), circle(point_of(a), point_of(b), point_of(c), point_of(d)));
}

// Promise: on every four points from the corners and middles of the range, the predicates equal 128-bit arithmetic:
// nothing overflows where the numbers are largest.
TEST(Predicates, ExactAtTheExtremes) {
    std::vector<PixelPoint> points;
    for (const std::int32_t x : {0, 1, kMeshCoordinateMax / 2, kMeshCoordinateMax - 1, kMeshCoordinateMax}) {
        for (const std::int32_t y : {0, 1, kMeshCoordinateMax / 2, kMeshCoordinateMax - 1, kMeshCoordinateMax}) {
            points.push_back({x, y});
        }
    }
    for (const PixelPoint a : points) {
        for (const PixelPoint b : points) {
            for (const PixelPoint c : points) {
                for (const PixelPoint d : points) expect_exact(a, b, c, d);
            }
        }
    }
}

// Promise: and on a million random ones.
TEST(Predicates, ExactOnRandomPoints) {
    Random random(1);
    for (int i = 0; i < 1000000; ++i) {
        const std::uint32_t range = 1U << (1 + random.below(14));
        const auto at = [&] {
            return PixelPoint{static_cast<std::int32_t>(random.below(range)),
                              static_cast<std::int32_t>(random.below(range))};
        };
        expect_exact(at(), at(), at(), at());
    }
}

// Promise: the tie rule is one rule: of the two diagonals of a cocircular quadrilateral it keeps the one that ends at
// the first point, whichever of the four asks, and in whichever rotation the triangle is given.
TEST(Predicates, TheTieRuleIsConsistent) {
    Random random(2);
    int ties = 0;
    for (int i = 0; i < 3000000; ++i) {
        const auto at = [&] {
            return PixelPoint{static_cast<std::int32_t>(random.below(7)), static_cast<std::int32_t>(random.below(7))};
        };
        const std::array<PixelPoint, 4> q = {at(), at(), at(), at()};
        // q counter-clockwise and convex
        bool is_convex = true;
        for (std::size_t k = 0; k < 4; ++k) is_convex &= orient2d(q[k], q[(k + 1) % 4], q[(k + 2) % 4]) > 0;
        if (!is_convex || in_circle(q[0], q[1], q[2], q[3]) != 0) continue;
        ++ties;
        const auto first = static_cast<std::size_t>(std::min_element(q.begin(), q.end(), is_before) - q.begin());
        for (std::size_t k = 0; k < 4; ++k) {
            // The triangle without q[k] has the diagonal that does not end at q[k]; it is kept if that one ends at
            // `first`.
            const bool is_kept = first % 2 != k % 2;
            const PixelPoint a = q[(k + 1) % 4], b = q[(k + 2) % 4], c = q[(k + 3) % 4], d = q[k];
            ASSERT_EQ(is_inside(a, b, c, d), !is_kept);
            ASSERT_EQ(is_inside(b, c, a, d), !is_kept);
            ASSERT_EQ(is_inside(c, a, b, d), !is_kept);
        }
        ASSERT_FALSE(is_inside(q[0], q[1], q[2], q[0]));
    }
    EXPECT_GT(ties, 1000);
}

}  // namespace
}  // namespace stillmesh::predicates_test
