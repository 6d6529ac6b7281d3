#include "engine/mesh/delaunay.hpp"

#include <gtest/gtest.h>

#include <algorithm>
#include <cstdint>
#include <vector>

#include "engine/base/random.hpp"
#include "engine/mesh/predicates.hpp"
#include "tests/mesh/mesh_checker.hpp"
#include "tests/mesh/rig.hpp"

namespace stillmesh {
namespace {

using mesh_checker::check_mesh;
using mesh_test::Rig;
using Points = std::vector<PixelPoint>;

std::string check(Rig& rig, const Points& points) {
    const Status status = rig.delaunay.triangulate(points);
    return check_mesh(points, status, rig.delaunay.mesh());
}

// Promise: every set of up to six points on a 5 x 5 grid, with all its collinear and cocircular cases, gives the mesh
// that brute force gives.
TEST(Delaunay, EverySmallSetOnAGrid) {
    Rig rig(6);
    std::uint32_t sets = 0;
    for (std::uint32_t set = 1; set < 1U << 25; ++set) {
        if (__builtin_popcount(set) > 6) continue;
        Points points;
        for (std::int32_t i = 0; i < 25; ++i) {
            if ((set >> i & 1U) != 0) points.push_back({i % 5, i / 5});
        }
        ++sets;
        ASSERT_EQ(check(rig, points), "") << "set " << set;
    }
    EXPECT_EQ(sets, 25U + 300 + 2300 + 12650 + 53130 + 177100);
}

Points random_points(Random& random, std::uint32_t count, std::uint32_t range) {
    Points points;
    for (std::uint32_t i = 0; i < count; ++i) {
        points.push_back(
            {static_cast<std::int32_t>(random.below(range)), static_cast<std::int32_t>(random.below(range))});
    }
    return points;
}

// Promise: 100 000 random sets of every size and density, from mostly duplicates to the whole range.
TEST(Delaunay, RandomSets) {
    Rig rig(300);
    Random random(1);
    for (int i = 0; i < 100000; ++i) {
        const std::uint32_t size_max = i % 100 == 0 ? 300 : i % 10 == 0 ? 60 : 12;
        const std::uint32_t range = 1 + random.below(1U << (1 + random.below(14)));
        const Points points = random_points(random, random.below(size_max + 1), range);
        ASSERT_EQ(check(rig, points), "") << "set " << i;
    }
}

}  // namespace
}  // namespace stillmesh
