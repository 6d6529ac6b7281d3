#include "engine/static_region/paper_choice.hpp"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <cstdint>
#include <set>
#include <tuple>
#include <utility>
#include <vector>

#include "engine/mesh/delaunay.hpp"
#include "engine/static_region/distance_consistency.hpp"
#include "engine/static_region/static_region.hpp"
#include "tests/static_region/scenes.hpp"
#include "tests/support/memory.hpp"

namespace stillmesh::paper_choice_test {
namespace {

using namespace test;

constexpr std::uint32_t kFeatures = 1000;

Parameters paper() {
    Parameters out;
    out.region.method = static_cast<std::uint32_t>(RegionMethod::kPaper);
    return as_in_paper(out);
}

SE3 moved_m(double z) {
    SE3 out;
    out.translation = Vector3(0, 0, z);
    return out;
}

// Nearly without noise: what the paper says is exact then.
void add(Scene& scene, double x, double y, double moved_by_m, int body, Random& random) {
    const Vector3 p = at_pixel(x, y, random.uniform(2.0, 2.6));
    Correspondence c = measure(p, moved_m(moved_by_m) * p, Noise{}, random);
    scene.add(c, body);
}

// Three columns of points, 24 px wide, 200 px high, that moved together.
void add_block(Scene& scene, double left, double moved_by_m, int body, Random& random) {
    for (int column = 0; column < 3; ++column) {
        for (int row = 0; row < 9; ++row) {
            add(scene, left + 12 * column, 140 + 25 * row, moved_by_m, body, random);
        }
    }
}

// A column of points so close that no edge of the mesh passes between them, each with a motion of its own: what is left
// and right of it is not connected, and none of it is in a group.
void add_fence(Scene& scene, double x, Random& random) {
    for (int row = 0; row < 120; ++row) add(scene, x, 60 + 3 * row, 100 + 0.7 * row + 0.01 * x, -1, random);
}

struct Rig {
    explicit Rig(Scene of) : scene(std::move(of)), context(context_at(SE3{})), region(limits_of(kFeatures, 1000)) {}
    RegionChoice choose(Random& random) {
        region->build(scene.correspondences, scene.keypoints, configuration.region, context);
        return region->choose(scene.correspondences, configuration, context, random);
    }
    // The one group of all points of a body; kNoGroup: they are not in one.
    std::uint16_t group_of_body(int body) {
        std::set<std::uint16_t> groups;
        for (std::size_t i = 0; i < scene.body.size(); ++i) {
            if (scene.body[i] == body) groups.insert(region->group_of(i));
        }
        return groups.size() == 1 ? *groups.begin() : kNoGroup;
    }
    Scene scene;
    Parameters configuration = paper();
    RegionContext context;
    InMemory<StaticRegion> region;
};

EdgeTest edge_test_of(const RegionParameters& region) {
    EdgeTest out;
    out.change_max_m = region.edge_change_max_m;
    out.chi2_max = region.edge_chi2_max;
    out.floor_m = region.edge_sigma_floor_m;
    return out;
}

// Promise: Algorithm 1: an edge is kept up to the fixed threshold and not beyond it, however small or large its noise.
TEST(PaperChoice, EdgesAreKeptBelowAFixedThreshold) {
    Random random(1);
    EdgeTest test = edge_test_of(paper().region);
    EXPECT_EQ(test.change_max_m, 0.1);
    EXPECT_EQ(as_in_paper(Parameters{Configuration::outdoor()}).region.edge_change_max_m, 0.5);
    std::size_t seen = 0;
    for (int i = 0; i < 2000; ++i) {
        Correspondence a = measure(random_point_in_view(random), Vector3::Zero(), Noise{}, random);
        Correspondence b = measure(random_point_in_view(random), Vector3::Zero(), Noise{}, random);
        a.p_world = random_motion(random, 1, 1) * a.p_camera;
        b.p_world = a.p_world + random_vector(random, 2);
        a.var_z = i % 2 == 0 ? 1e-12 : random.uniform(0, 10);
        const double change = std::abs((a.p_camera - b.p_camera).norm() - (a.p_world - b.p_world).norm());
        if (change > 2.5) continue;
        ++seen;
        test.change_max_m = change + 1e-9;
        EXPECT_TRUE(keeps_distance(a, b, test));
        test.change_max_m = change - 1e-9;
        EXPECT_FALSE(keeps_distance(a, b, test));
    }
    EXPECT_GT(seen, 1000U);
}

// Promise: groups are what the kept edges connect, found by flood fill, the largest first; a vertex that lost all its
// edges is in none, and neither is a match without depth.
TEST(PaperChoice, GroupsAreWhatKeptEdgesConnect) {
    std::size_t groups_seen = 0, alone = 0;
    for (std::uint64_t seed = 0; seed < 60; ++seed) {
        Random random(seed);
        Scene scene;
        std::set<std::pair<int, int>> used;
        for (std::uint32_t i = 0, count = 3 + random.below(seed % 2 == 0 ? 20 : 300); i < count; ++i) {
            const int x = static_cast<int>(random.below(640)), y = static_cast<int>(random.below(480));
            if (!used.insert({x, y}).second) continue;
            const int body = (x / 213) % 2 + 2 * ((y / 160) % 2);
            add(scene, x, y, random.below(6) == 0 ? random.uniform(10, 500) : 3.0 * body, body, random);
            if (random.below(20) == 0) scene.correspondences.back().has_depth = false;
        }
        Rig rig(std::move(scene));
        InMemory<MeshGroups> groups(limits_of(kFeatures, 1000));
        groups->build(rig.scene.correspondences, rig.scene.keypoints, rig.configuration.region, rig.context);
        const Mesh& mesh = groups->mesh();
        std::vector<std::vector<std::size_t>> wanted;
        std::vector<bool> is_done(mesh.vertices.size());
        for (std::size_t first = 0; first < mesh.vertices.size(); ++first) {
            if (is_done[first]) continue;
            std::vector<std::size_t> here = {first};
            is_done[first] = true;
            for (std::size_t k = 0; k < here.size(); ++k) {
                for (std::size_t e = 0; e < mesh.edges.size(); ++e) {
                    const std::size_t a = mesh.edges[e].a, b = mesh.edges[e].b;
                    const Correspondence& ca = rig.scene.correspondences[groups->correspondence_of(a)];
                    const Correspondence& cb = rig.scene.correspondences[groups->correspondence_of(b)];
                    ASSERT_EQ(groups->is_kept(e), keeps_distance(ca, cb, edge_test_of(rig.configuration.region)));
                    if (!groups->is_kept(e) || (a != here[k] && b != here[k])) continue;
                    const std::size_t other = a == here[k] ? b : a;
                    if (is_done[other]) continue;
                    is_done[other] = true;
                    here.push_back(other);
                }
            }
            wanted.push_back(here);
        }
        std::stable_sort(wanted.begin(), wanted.end(),
                         [](const auto& a, const auto& b) { return a.size() > b.size(); });
        std::uint32_t count = 0;
        for (std::size_t g = 0; g < wanted.size(); ++g) {
            const bool is_group = wanted[g].size() > 1;
            count += is_group ? 1U : 0U;
            alone += is_group ? 0U : 1U;
            for (const std::size_t v : wanted[g]) {
                ASSERT_EQ(groups->group_of_vertex(v), is_group ? g : kNoGroup) << "seed " << seed;
            }
        }
        EXPECT_EQ(groups->count(), count);
        groups_seen += count;
        for (std::size_t i = 0; i < rig.scene.correspondences.size(); ++i) {
            if (!rig.scene.correspondences[i].has_depth) {
                EXPECT_EQ(groups->group_of(i), kNoGroup);
            }
        }
    }
    EXPECT_GT(groups_seen, 200U);
    EXPECT_GT(alone, 200U);
}

// Promise: the outline of a group is the boundary of the mesh that Delaunay makes of its points alone: its corners are
// on that mesh's hull, none of its points lies outside, and the area is the sum of that mesh's triangles.
TEST(PaperChoice, OutlineIsThatOfTheGroupsOwnMesh) {
    for (std::uint64_t seed = 0; seed < 200; ++seed) {
        Random random(seed);
        Scene scene;
        const std::uint32_t count = 2 + random.below(40);
        const double width = seed % 3 == 0 ? 6 : 300;  // so narrow that many lie on lines
        for (std::uint32_t i = 0; i < count; ++i) {
            const double y = seed % 7 == 0 ? 200.0 : 100 + random.below(200);
            add(scene, 100 + random.below(static_cast<std::uint32_t>(width)), y, 0, 0, random);
        }
        for (std::uint32_t i = 0; i < 30; ++i)
            add(scene, random.below(640), random.below(480), 100 + 2.0 * i, -1, random);
        Rig rig(std::move(scene));
        InMemory<MeshGroups> groups(limits_of(kFeatures, 1000));
        groups->build(rig.scene.correspondences, rig.scene.keypoints, rig.configuration.region, rig.context);
        if (groups->count() == 0) continue;
        std::vector<PixelPoint> own;
        for (std::size_t v = 0; v < groups->mesh().vertices.size(); ++v) {
            if (groups->group_of_vertex(v) == 0) own.push_back(groups->mesh().vertices[v]);
        }
        InMemory<Delaunay> alone(static_cast<std::uint32_t>(own.size()));
        static_cast<void>(alone->triangulate(own));
        double area = 0;
        for (const MeshTriangle& t : alone->mesh().triangles) {
            const PixelPoint a = own[t.vertex[0]], b = own[t.vertex[1]], c = own[t.vertex[2]];
            area += 0.5 * ((b.x - a.x) * (c.y - a.y) - (b.y - a.y) * (c.x - a.x)) / 64.0;
        }
        std::set<std::pair<int, int>> hull;
        for (const MeshEdge& e : alone->mesh().edges) {
            if (e.left_triangle != kNoTriangle && e.right_triangle != kNoTriangle) continue;
            hull.insert({own[e.a].x, own[e.a].y});
            hull.insert({own[e.b].x, own[e.b].y});
        }
        InMemory<FixedVector<std::uint16_t>> outline(std::size_t{kFeatures});
        outline_of(*groups, 0, *outline);
        EXPECT_NEAR(twice_area(groups->mesh(), outline->span()), 2 * 64 * area, 1e-6) << "seed " << seed;
        ASSERT_GE(outline->size(), 2U);
        EXPECT_EQ(outline->size() == 2, alone->mesh().triangles.empty());
        for (std::size_t k = 0; k < outline->size(); ++k) {
            const PixelPoint a = groups->mesh().vertices[(*outline)[k]];
            const PixelPoint b = groups->mesh().vertices[(*outline)[(k + 1) % outline->size()]];
            EXPECT_TRUE(hull.contains({a.x, a.y}));
            for (const PixelPoint p : own) EXPECT_GE((b.x - a.x) * (p.y - a.y) - (b.y - a.y) * (p.x - a.x), 0);
        }
    }
}

// Promise: the distance between boundary lines: by hand for squares side by side, corner to corner, one in the other,
// crossing and touching; for any polygons that of many points along both, and 0 where they cross.
TEST(PaperChoice, BoundaryDistanceByHandAndBySampling) {
    std::vector<PixelPoint> vertices;
    const auto polygon = [&](std::vector<std::pair<double, double>> corners_px) {
        std::vector<std::uint16_t> out;
        for (const auto& [x, y] : corners_px) {
            out.push_back(static_cast<std::uint16_t>(vertices.size()));
            vertices.push_back({static_cast<std::int32_t>(x * 8), static_cast<std::int32_t>(y * 8)});
        }
        return out;
    };
    const auto square = [&](double left, double top, double side) {
        return polygon({{left, top}, {left + side, top}, {left + side, top + side}, {left, top + side}});
    };
    const auto distance = [&](const std::vector<std::uint16_t>& a, const std::vector<std::uint16_t>& b) {
        Mesh mesh;
        mesh.vertices = vertices;
        EXPECT_EQ(boundary_distance_px(mesh, a, b), boundary_distance_px(mesh, b, a));
        return boundary_distance_px(mesh, a, b);
    };
    const auto big = square(100, 100, 100);
    EXPECT_DOUBLE_EQ(distance(big, square(209.5, 120, 30)), 9.5);
    EXPECT_DOUBLE_EQ(distance(big, square(203, 204, 50)), 5.0);
    EXPECT_DOUBLE_EQ(distance(big, square(130, 140, 30)), 30.0) << "inside: its line is far from the other line";
    EXPECT_DOUBLE_EQ(distance(big, square(180, 150, 100)), 0.0);
    EXPECT_DOUBLE_EQ(distance(big, square(200, 120, 30)), 0.0);
    EXPECT_DOUBLE_EQ(distance(big, polygon({{220, 90}, {220, 300}})), 20.0) << "points on one line";
    Random random(2);
    std::size_t apart = 0;
    for (int i = 0; i < 100; ++i) {
        const auto triangle = [&](double left) {
            std::vector<std::pair<double, double>> corners;
            for (int k = 0; k < 3; ++k) corners.emplace_back(left + random.below(100), random.below(200));
            return polygon(corners);
        };
        const auto a = triangle(50), b = triangle(90);
        const double found = distance(a, b);
        const auto along = [&](const std::vector<std::uint16_t>& outline, int step) -> Vector2 {
            const double t = step / 300.0 * 3;
            const auto k = std::min<std::size_t>(static_cast<std::size_t>(t), 2);
            const PixelPoint from = vertices[outline[k]], to = vertices[outline[(k + 1) % 3]];
            const double s = t - static_cast<double>(k);
            return Vector2(from.x + s * (to.x - from.x), from.y + s * (to.y - from.y)) / 8.0;
        };
        double sampled = 1e9;
        for (int j = 0; j <= 300; ++j) {
            for (int k = 0; k <= 300; ++k) sampled = std::min(sampled, (along(a, j) - along(b, k)).norm());
        }
        EXPECT_LE(found, sampled + 1e-9);
        EXPECT_GE(found, sampled - 2.5) << "samples are up to 2.3 px apart";
        apart += found > 0 ? 1U : 0U;
    }
    EXPECT_GT(apart, 20U);
    EXPECT_LT(apart, 80U);
}

// Promise: Eq. 1 by hand: of two squares that moved apart the one with more of W1 N / N_all + W2 S / S_all is chosen,
// with the area as long as the other has not fifteen times as many points; all its members and nothing else are chosen,
// and only they have a say.
TEST(PaperChoice, EquationOneByHand) {
    for (const int side : {3, 6, 12}) {
        Random random(3);
        Scene scene;
        // 200 x 200 px with 9 points; 100 x 100 px with 9, 36 or 144.
        for (int i = 0; i < 9; ++i) add(scene, 50 + 100 * (i % 3), 50 + 100 * (i / 3), 0, 0, random);
        for (int i = 0; i < side * side; ++i) {
            add(scene, 350 + 100.0 / (side - 1) * (i % side), 100 + 100.0 / (side - 1) * (i / side), 5, 1, random);
        }
        Rig rig(std::move(scene));
        const RegionChoice choice = rig.choose(random);
        ASSERT_TRUE(choice.is_valid);
        // The hull: (50, 50), (250, 50), (450, 100), (450, 200), (250, 250), (50, 250).
        const double all = 200 * 200 + 200 * (200 + 100) / 2.0;
        const double n = 9 + side * side;
        const double first = 0.5 * 9 / n + 200 * 200 / all;
        const double second = 0.5 * side * side / n + 100 * 100 / all;
        const bool is_second = side == 12;
        ASSERT_EQ(second > first, is_second);
        EXPECT_NEAR(choice.score, std::max(first, second) / 1.5, 1e-3) << "pixels are on a grid of 1/8";
        EXPECT_EQ(choice.margin, 1.0);
        EXPECT_LT(metres_between(choice.world_from_camera, moved_m(is_second ? 5 : 0)), 1e-6);
        std::vector<std::uint16_t> members;
        for (int i = is_second ? 9 : 0; i < (is_second ? 9 + side * side : 9); ++i) {
            members.push_back(static_cast<std::uint16_t>(i));
        }
        EXPECT_EQ(std::vector<std::uint16_t>(rig.region->chosen().begin(), rig.region->chosen().end()), members);
        EXPECT_EQ(rig.region->agreement_of(rig.region->group_of(0)), is_second ? 0.0 : 1.0);
        EXPECT_EQ(rig.region->agreement_of(rig.region->group_of(9)), is_second ? 1.0 : 0.0);
        EXPECT_EQ(rig.region->agreement_of(kNoGroup), 0.0);
    }
}

// Promise: two groups of one motion whose boundaries are 8 px apart become one where a third group moved otherwise, and
// keep the number of the larger; at 16 px they stay two, but not in an image twice as wide.
TEST(PaperChoice, SimilarAndCloseGroupsMerge) {
    for (const auto& [gap_px, width_px, merges] :
         {std::tuple{8, 640, true}, {16, 640, false}, {16, 1280, true}, {8, 320, false}}) {
        Random random(4);
        Scene scene;
        add_block(scene, 100, 0, 0, random);
        add_fence(scene, 124 + gap_px / 2, random);
        add_block(scene, 124 + gap_px, 0, 1, random);
        add(scene, 160 + gap_px, 240, 0, 1, random);  // the larger one
        add_fence(scene, 300, random);
        add_block(scene, 400, 5, 2, random);
        Rig rig(std::move(scene));
        rig.context.image_width_px = static_cast<std::uint32_t>(width_px);
        const RegionChoice choice = rig.choose(random);
        ASSERT_TRUE(choice.is_valid);
        ASSERT_NE(rig.group_of_body(0), kNoGroup);
        ASSERT_NE(rig.group_of_body(1), kNoGroup);
        EXPECT_EQ(rig.group_of_body(0) == rig.group_of_body(1), merges) << gap_px << " px at " << width_px;
        EXPECT_EQ(rig.group_of_body(1), 0U);
        EXPECT_EQ(rig.region->chosen().size(), merges ? 55U : 28U);
        EXPECT_NE(rig.group_of_body(2), rig.group_of_body(1));
    }
}

// Promise: the defect of the rule is there, as the paper has it: two groups alone never merge, though their motion is
// the same and they all but touch; and a group far off makes two others similar that are not.
TEST(PaperChoice, TwoGroupsNeverMergeAndAWildOneMakesOthersSimilar) {
    Random random(5);
    Scene two;
    add_block(two, 100, 0, 0, random);
    add_fence(two, 128, random);
    add_block(two, 132, 0, 1, random);
    Rig alone(two);
    ASSERT_TRUE(alone.choose(random).is_valid);
    EXPECT_NE(alone.group_of_body(0), alone.group_of_body(1));
    EXPECT_EQ(alone.region->chosen().size(), 27U);
    for (const double wild_m : {4.0, 6.0}) {
        Scene three;
        add_block(three, 100, 0, 0, random);
        add_fence(three, 128, random);
        add_block(three, 132, 1, 1, random);
        add_fence(three, 300, random);
        add_block(three, 400, wild_m, 2, random);
        Rig rig(three);
        ASSERT_TRUE(rig.choose(random).is_valid);
        EXPECT_EQ(rig.group_of_body(0) == rig.group_of_body(1), wild_m > 5);
    }
}

// Promise: what is similar is measured by the largest difference of all pairs, that of the first two groups too.
TEST(PaperChoice, AnyPairMayBeTheMostDifferent) {
    for (const double second_m : {5.6, 4.7}) {
        Random random(6);
        Scene scene;
        add_block(scene, 100, 0, 0, random);
        add_fence(scene, 200, random);
        add_block(scene, 300, second_m, 1, random);
        add_fence(scene, 328, random);
        add_block(scene, 332, second_m - 1, 2, random);
        Rig rig(std::move(scene));
        ASSERT_TRUE(rig.choose(random).is_valid);
        ASSERT_EQ(rig.group_of_body(0), 0U);
        ASSERT_EQ(rig.group_of_body(1), 1U);
        EXPECT_EQ(rig.group_of_body(1) == rig.group_of_body(2), second_m > 5) << second_m;
    }
}

// Promise: clustering goes on until no two groups are eligible: of blocks in a row, with motions that differ, those
// stand together in the end that are connected through neighbours of the same motion nearer than the limit; the cluster
// with the most of Eq. 1 is chosen, whole.
TEST(PaperChoice, ClustersEqualBruteForce) {
    std::size_t merged = 0, kept_apart = 0;
    for (std::uint64_t seed = 0; seed < 60; ++seed) {
        Random random(seed);
        constexpr double kMotions_m[] = {0, 5, 8};
        const int blocks = 3 + static_cast<int>(random.below(3));
        std::vector<int> motion(static_cast<std::size_t>(blocks));
        for (int& m : motion) m = static_cast<int>(random.below(3));
        if (std::all_of(motion.begin(), motion.end(), [&](int m) { return m == motion[0]; })) continue;
        std::vector<double> left = {60};
        Scene scene;
        for (std::size_t b = 0; b < motion.size(); ++b) {
            add_block(scene, left[b], kMotions_m[motion[b]], static_cast<int>(b), random);
            const double gap = random.below(2) == 0 ? 8 : 16;
            if (b + 1 < motion.size()) add_fence(scene, left[b] + 24 + gap / 2, random);
            left.push_back(left[b] + 24 + gap);
        }
        Rig rig(std::move(scene));
        const RegionChoice choice = rig.choose(random);
        ASSERT_TRUE(choice.is_valid);
        std::vector<std::size_t> cluster = {0};  // by block: the first block of its cluster
        for (std::size_t b = 1; b < motion.size(); ++b) {
            const bool is_joined = motion[b] == motion[b - 1] && left[b] - left[b - 1] == 32;
            cluster.push_back(is_joined ? cluster.back() : b);
            ++(is_joined ? merged : kept_apart);
        }
        std::size_t longest = 0;  // blocks are alike: the cluster of most blocks has most points and area, or is first
        std::vector<std::size_t> size(motion.size());
        for (const std::size_t c : cluster) ++size[c];
        for (std::size_t b = 0; b < motion.size(); ++b) {
            for (std::size_t other = 0; other < motion.size(); ++other) {
                ASSERT_NE(rig.group_of_body(static_cast<int>(b)), kNoGroup) << "seed " << seed;
                EXPECT_EQ(rig.group_of_body(static_cast<int>(b)) == rig.group_of_body(static_cast<int>(other)),
                          cluster[b] == cluster[other])
                    << "seed " << seed << ": blocks " << b << " and " << other;
            }
            longest = std::max(longest, size[b]);
        }
        std::set<std::uint16_t> chosen_groups;
        for (const std::uint16_t i : rig.region->chosen()) chosen_groups.insert(rig.region->group_of(i));
        EXPECT_EQ(chosen_groups.size(), 1U);
        EXPECT_EQ(rig.region->chosen().size(), 27 * longest) << "seed " << seed;
    }
    EXPECT_GT(merged, 20U);
    EXPECT_GT(kept_apart, 50U);
}

// Promise: nothing, next to nothing, points on a line, groups too small for a pose: no valid choice, nothing chosen, no
// crash; iterations stay within the budget of all groups; with the region's extraction off the method does not matter.
TEST(PaperChoice, DegenerateInputAndBudget) {
    Random random(6);
    for (const std::uint32_t count : {0U, 1U, 2U, 3U, 5U}) {
        Scene scene;
        for (std::uint32_t i = 0; i < count; ++i) add(scene, 100 + 10.0 * i, 200, 0, 0, random);
        Rig rig(std::move(scene));
        EXPECT_FALSE(rig.choose(random).is_valid) << count;
        EXPECT_TRUE(rig.region->chosen().empty());
    }
    Scene scene;
    for (int b = 0; b < 6; ++b) {
        add_block(scene, 20 + 70 * b, 3.0 * b, b, random);
        add_fence(scene, 20 + 70 * b + 47, random);
    }
    Rig rig(scene);
    for (const std::uint32_t most : {1U, 10U, 100U}) {
        rig.configuration.pose.coarse_total_max = most;
        EXPECT_LE(rig.choose(random).iterations, most);
    }
    Rig off(scene);
    off.configuration.region.is_enabled = false;
    Rig ours(scene);
    ours.configuration.region = off.configuration.region;
    ours.configuration.region.method = static_cast<std::uint32_t>(RegionMethod::kOurs);
    Random a(7), b(7);
    EXPECT_EQ(off.choose(a).score, ours.choose(b).score);
    EXPECT_EQ(a.next(), b.next());
}

}  // namespace
}  // namespace stillmesh::paper_choice_test
