#include "engine/mesh/delaunay.hpp"

#include <gtest/gtest.h>

#include <algorithm>
#include <array>
#include <cstdint>
#include <string>
#include <vector>

#include "engine/base/random.hpp"
#include "engine/mesh/predicates.hpp"
#include "tests/mesh/mesh_checker.hpp"
#include "tests/mesh/rig.hpp"

namespace stillmesh::delaunay_test {
namespace {

using mesh_checker::check_mesh;
using testing::MeshRig;
using Points = std::vector<PixelPoint>;

std::string check(MeshRig& rig, const Points& points) {
    const Status status = rig.delaunay.triangulate(points);
    return check_mesh(points, status, rig.delaunay.mesh());
}

// Promise: every set of up to six points on a 5 x 5 grid, with all its collinear and cocircular cases, gives the mesh
// that brute force gives.
TEST(Delaunay, EverySmallSetOnAGrid) {
    MeshRig rig(6);
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
    MeshRig rig(300);
    Random random(1);
    for (int i = 0; i < 100000; ++i) {
        const std::uint32_t size_max = i % 100 == 0 ? 300 : i % 10 == 0 ? 60 : 12;
        const std::uint32_t range = 1 + random.below(1U << (1 + random.below(14)));
        const Points points = random_points(random, random.below(size_max + 1), range);
        ASSERT_EQ(check(rig, points), "") << "set " << i;
    }
}

// Promise: lattices, where every square is a tie, are meshed, coarse and fine, upright and sheared.
TEST(Delaunay, Lattices) {
    MeshRig rig(2500);
    for (const std::int32_t step : {1, 2, 7, 8, 37, 64, 300}) {
        for (const std::int32_t shear : {0, 1, 3}) {
            for (const std::int32_t side : {2, 3, 10, 33, 50}) {
                Points points;
                for (std::int32_t y = 0; y < side; ++y) {
                    for (std::int32_t x = 0; x < side; ++x) {
                        const PixelPoint p{x * step + y * shear, y * step};
                        if (p.x <= kMeshCoordinateMax && p.y <= kMeshCoordinateMax) points.push_back(p);
                    }
                }
                ASSERT_EQ(check(rig, points), "") << "step " << step << " shear " << shear << " side " << side;
            }
        }
    }
}

// Promise: points on one line, in every direction and any order, give the chain of neighbours and kDegenerate; one
// point beside the line makes it a mesh.
TEST(Delaunay, Lines) {
    MeshRig rig(501);
    Random random(2);
    for (const PixelPoint direction : {PixelPoint{1, 0}, {0, 1}, {1, 1}, {1, -1}, {3, 2}, {2, -5}, {32, 1}, {-1, 32}}) {
        for (const std::uint32_t count : {2U, 3U, 4U, 5U, 17U, 500U}) {
            Points points;
            for (std::uint32_t i = 0; i < count; ++i) {
                const auto k = static_cast<std::int32_t>(random.below(count));
                points.push_back({8000 + direction.x * (k - 250), 8000 + direction.y * (k - 250)});
            }
            ASSERT_EQ(check(rig, points), "") << direction.x << ", " << direction.y << " x " << count;
            points.push_back({7, 100});
            ASSERT_EQ(check(rig, points), "") << direction.x << ", " << direction.y << " x " << count;
        }
    }
}

// All lattice points at this squared distance from the centre.
Points circle_points(std::int32_t squared_radius, PixelPoint centre) {
    Points points;
    for (std::int32_t x = -8000; x <= 8000; ++x) {
        const std::int32_t rest = squared_radius - x * x;
        if (rest < 0) continue;
        auto y = static_cast<std::int32_t>(__builtin_sqrt(static_cast<double>(rest)));
        while (y * y > rest) --y;
        while ((y + 1) * (y + 1) <= rest) ++y;
        if (y * y != rest) continue;
        points.push_back({centre.x + x, centre.y + y});
        if (y != 0) points.push_back({centre.x + x, centre.y - y});
    }
    return points;
}

// Promise: points that all lie on one circle, exactly, become a fan around their first by (x, y); with the centre, a
// wheel.
TEST(Delaunay, Circles) {
    MeshRig rig(1000);
    for (const std::int32_t squared_radius : {1, 5, 25, 65, 325, 1105, 5525, 27625, 32045, 160225, 1185665, 5928325}) {
        Points points = circle_points(squared_radius, {8000, 8000});
        ASSERT_GE(points.size(), 4U);
        ASSERT_EQ(check(rig, points), "") << "squared radius " << squared_radius;
        const PixelPoint first = *std::min_element(points.begin(), points.end(), is_before);
        for (const MeshTriangle& triangle : rig.delaunay.mesh().triangles) {
            EXPECT_TRUE(std::any_of(std::begin(triangle.vertex), std::end(triangle.vertex),
                                    [&](std::uint32_t v) { return rig.delaunay.mesh().vertices[v] == first; }));
        }
        points.push_back({8000, 8000});
        ASSERT_EQ(check(rig, points), "") << "squared radius " << squared_radius << " with centre";
        EXPECT_EQ(rig.delaunay.mesh().triangles.size(), points.size() - 1);
    }
}

// Promise: the corners and sides of the whole range, where numbers are largest, are exact.
TEST(Delaunay, Extremes) {
    constexpr std::int32_t kMax = kMeshCoordinateMax;
    MeshRig rig(600);
    EXPECT_EQ(check(rig, {{0, 0}, {kMax, kMax}, {0, kMax}, {kMax, 0}}), "");
    EXPECT_EQ(check(rig, {{kMax, kMax}}), "");
    Random random(3);
    for (int i = 0; i < 300; ++i) {
        Points points;
        const std::uint32_t count = 4 + random.below(500);
        const auto near_end = [&] {
            const auto off = static_cast<std::int32_t>(random.below(3));
            return random.below(2) == 0 ? off : kMax - off;
        };
        const auto anywhere = [&] { return static_cast<std::int32_t>(random.below(kMax + 1)); };
        for (std::uint32_t k = 0; k < count; ++k) {
            switch (random.below(3)) {
                case 0: points.push_back({near_end(), near_end()}); break;
                case 1: points.push_back({near_end(), anywhere()}); break;
                default: points.push_back({anywhere(), near_end()}); break;
            }
        }
        ASSERT_EQ(check(rig, points), "") << i;
    }
}

// Promise: full-size sets: even, in one column, in one row, in clusters, with many duplicates.
TEST(Delaunay, LargeSets) {
    MeshRig rig(5000);
    Random random(4);
    for (int i = 0; i < 40; ++i) {
        Points points;
        for (int k = 0; k < 5000; ++k) {
            const auto a = static_cast<std::int32_t>(random.below(kMeshCoordinateMax + 1));
            const auto b = static_cast<std::int32_t>(random.below(40));
            const auto c = static_cast<std::int32_t>(random.below(60));
            switch (i % 5) {
                case 0: points.push_back({a, static_cast<std::int32_t>(random.below(kMeshCoordinateMax + 1))}); break;
                case 1: points.push_back({b, a}); break;
                case 2: points.push_back({a, b}); break;
                case 3: points.push_back({4000 * (a % 4) + b, 4000 * (b % 4) + c}); break;
                default: points.push_back({b, c}); break;
            }
        }
        ASSERT_EQ(check(rig, points), "") << i;
    }
}

// Triangles by coordinates: what a mesh is, whatever the numbers of its vertices.
std::vector<std::array<mesh_checker::Point, 3>> shape_of(const Mesh& mesh) {
    std::vector<std::array<mesh_checker::Point, 3>> shape;
    for (const MeshTriangle& triangle : mesh.triangles) {
        std::array<mesh_checker::Point, 3> corners;
        for (std::size_t k = 0; k < 3; ++k) corners[k] = mesh_checker::point_of(mesh.vertices[triangle.vertex[k]]);
        std::sort(corners.begin(), corners.end());
        shape.push_back(corners);
    }
    std::sort(shape.begin(), shape.end());
    return shape;
}

// Promise: the mesh depends on the set of points alone, not on their order, ties included.
TEST(Delaunay, OrderOfInputDoesNotMatter) {
    MeshRig rig(400);
    Random random(5);
    for (int i = 0; i < 2000; ++i) {
        Points points = random_points(random, 1 + random.below(i % 20 == 0 ? 400 : 30), 3 + random.below(30));
        ASSERT_EQ(check(rig, points), "");
        const auto expected = shape_of(rig.delaunay.mesh());
        for (std::size_t k = points.size(); k > 1; --k) {
            std::swap(points[k - 1], points[random.below(static_cast<std::uint32_t>(k))]);
        }
        ASSERT_EQ(check(rig, points), "");
        ASSERT_EQ(shape_of(rig.delaunay.mesh()), expected) << i;
    }
}

// Promise: the mesh follows its points when they move as a whole: ties are not decided by where the grid's origin is,
// nor by where the strips are cut.
TEST(Delaunay, MovesWithItsPoints) {
    MeshRig rig(1000);
    Random random(6);
    for (int i = 0; i < 100; ++i) {
        Points points = random_points(random, 1000, 60);
        ASSERT_EQ(check(rig, points), "");
        const std::vector<MeshTriangle> before(rig.delaunay.mesh().triangles.begin(),
                                               rig.delaunay.mesh().triangles.end());
        const auto dx = static_cast<std::int32_t>(random.below(16000)),
                   dy = static_cast<std::int32_t>(random.below(16000));
        for (PixelPoint& p : points) p = {p.x + dx, p.y + dy};
        ASSERT_EQ(check(rig, points), "");
        const auto after = rig.delaunay.mesh().triangles;
        ASSERT_EQ(before.size(), after.size());
        for (std::size_t t = 0; t < before.size(); ++t) {
            ASSERT_TRUE(std::equal(std::begin(before[t].vertex), std::end(before[t].vertex), after[t].vertex)) << t;
        }
    }
}

// Promise: too many points is kFull, a coordinate out of range kInvalid, both with an empty mesh; the next call works.
TEST(Delaunay, RefusesWhatItCannotDo) {
    MeshRig rig(4);
    const Points good = {{0, 0}, {9, 0}, {0, 9}, {9, 9}};
    const auto is_empty = [&] {
        const Mesh& mesh = rig.delaunay.mesh();
        return mesh.vertices.empty() && mesh.vertex_of_point.empty() && mesh.edges.empty() && mesh.triangles.empty();
    };
    EXPECT_TRUE(is_empty());
    EXPECT_EQ(check(rig, good), "");
    EXPECT_EQ(rig.delaunay.triangulate(Points{{0, 0}, {9, 0}, {0, 9}, {9, 9}, {0, 0}}), Status::kFull);
    EXPECT_TRUE(is_empty());
    for (const std::int32_t bad : {-1, kMeshCoordinateMax + 1, INT32_MIN, INT32_MAX}) {
        EXPECT_EQ(check(rig, good), "");
        EXPECT_EQ(rig.delaunay.triangulate(Points{{0, 0}, {9, bad}, {0, 9}}), Status::kInvalid);
        EXPECT_TRUE(is_empty());
        EXPECT_EQ(rig.delaunay.triangulate(Points{{0, 0}, {9, 0}, {bad, 9}}), Status::kInvalid);
        EXPECT_TRUE(is_empty());
    }
    EXPECT_EQ(rig.delaunay.triangulate(Points{}), Status::kDegenerate);
    EXPECT_TRUE(is_empty());
    EXPECT_EQ(check(rig, Points(4, PixelPoint{5, 5})), "");
    EXPECT_EQ(check(rig, {{5, 5}, {5, 5}, {6, 5}}), "");
    EXPECT_EQ(check(rig, good), "");
}

// Promise: create uses exactly the planned bytes, for any size, none included; and a full one still works.
TEST(Delaunay, UsesExactlyThePlannedMemory) {
    Random random(7);
    for (const std::uint32_t points_max : {0U, 1U, 2U, 3U, 4U, 5U, 100U, 500U, 1000U}) {
        MeshRig rig(points_max);
        EXPECT_EQ(rig.used_bytes(), MeshRig::planned_bytes(points_max));
        EXPECT_EQ(check(rig, random_points(random, points_max, 1000)), "");
        EXPECT_EQ(rig.delaunay.triangulate(random_points(random, points_max + 1, 1000)), Status::kFull);
    }
    // A triangular hull with everything inside: as many edges and triangles as there can be.
    MeshRig rig(503);
    Points points = {{0, 0}, {16383, 0}, {0, 16383}};
    for (const PixelPoint p : random_points(random, 500, 4000)) points.push_back({p.x + 1, p.y + 1});
    std::sort(points.begin(), points.end(), is_before);
    points.erase(std::unique(points.begin(), points.end()), points.end());
    EXPECT_EQ(check(rig, points), "");
    EXPECT_EQ(rig.delaunay.mesh().triangles.size(), mesh_triangles_max(static_cast<std::uint32_t>(points.size())));
    EXPECT_EQ(rig.delaunay.mesh().edges.size(), mesh_edges_max(static_cast<std::uint32_t>(points.size())));
}

}  // namespace
}  // namespace stillmesh::delaunay_test
