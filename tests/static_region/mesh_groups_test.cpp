#include "engine/static_region/mesh_groups.hpp"

#include <gtest/gtest.h>

#include <algorithm>
#include <cstdint>
#include <map>
#include <set>
#include <vector>

#include "engine/static_region/distance_consistency.hpp"
#include "tests/static_region/scenes.hpp"
#include "tests/support/memory.hpp"

namespace stillmesh::mesh_groups_test {
namespace {

using namespace test;
using Groups = InMemory<MeshGroups>;

// Promise: edges are kept by the distance test alone; groups are what whole triangles connect through shared edges,
// numbered by descending size, a shared vertex in the larger.
TEST(MeshGroups, GroupsEqualBruteForce) {
    std::size_t groups_seen = 0;
    for (std::uint64_t seed = 0; seed < 60; ++seed) {
        Random random(seed);
        const SE3 pose = test::random_motion(random, 0.5, 0.3);
        Vector3 shifts[4];
        for (Vector3& shift : shifts) shift = test::random_vector(random, 1.0);
        // Depths so near each other that nothing is a step in depth.
        Scene scene;
        const std::uint32_t count = 3 + random.below(seed % 2 == 0 ? 20 : 300);
        std::set<std::pair<int, int>> used;
        for (std::uint32_t i = 0; i < count; ++i) {
            const int x = static_cast<int>(random.below(640)), y = static_cast<int>(random.below(480));
            if (!used.insert({x, y}).second) continue;
            const Vector3 p = at_pixel(x, y, random.uniform(2.0, 2.08));
            const int body = (x / 213) % 2 + 2 * ((y / 160) % 2);
            auto c = test::measure(p, pose * p, Noise{}, random);
            if (body != 0) c.p_world += shifts[body];
            if (random.below(20) == 0) c.has_depth = false;
            scene.add(c, body);
        }
        Groups groups(limits_of(400));
        const RegionParameters parameters;
        const RegionContext context = context_at(pose);
        groups->build(scene.correspondences, scene.keypoints, parameters, context);
        const Mesh& mesh = groups->mesh();
        std::vector<std::size_t> with_depth;  // by point of the mesh
        for (std::size_t i = 0; i < scene.correspondences.size(); ++i) {
            if (scene.correspondences[i].has_depth) with_depth.push_back(i);
        }
        ASSERT_EQ(mesh.vertex_of_point.size(), with_depth.size());
        std::vector<std::size_t> of_vertex(mesh.vertices.size());
        for (std::size_t i = 0; i < with_depth.size(); ++i) of_vertex[mesh.vertex_of_point[i]] = with_depth[i];
        EdgeTest test;
        test.camera_from_world_rotation = pose.rotation.transpose();
        std::uint32_t kept = 0;
        for (std::size_t i = 0; i < mesh.edges.size(); ++i) {
            const bool keeps = keeps_distance(scene.correspondences[of_vertex[mesh.edges[i].a]],
                                              scene.correspondences[of_vertex[mesh.edges[i].b]], test);
            ASSERT_EQ(groups->is_kept(i), keeps);
            kept += keeps ? 1U : 0U;
        }
        EXPECT_EQ(groups->kept_count(), kept);
        // Flood over whole triangles.
        const std::size_t triangles = mesh.triangles.size();
        const auto is_whole = [&](std::size_t t) {
            return std::all_of(std::begin(mesh.triangles[t].edge), std::end(mesh.triangles[t].edge),
                               [&](std::uint32_t e) { return groups->is_kept(e); });
        };
        std::vector<int> component(triangles, -1);
        std::vector<std::size_t> sizes;
        for (std::size_t t = 0; t < triangles; ++t) {
            if (!is_whole(t) || component[t] >= 0) continue;
            const int name = static_cast<int>(sizes.size());
            std::vector<std::size_t> todo = {t};
            component[t] = name;
            sizes.push_back(0);
            while (!todo.empty()) {
                const std::size_t here = todo.back();
                todo.pop_back();
                ++sizes.back();
                for (std::size_t other = 0; other < triangles; ++other) {
                    if (component[other] >= 0 || !is_whole(other)) continue;
                    int shared = 0;
                    for (const std::uint32_t e : mesh.triangles[here].edge) {
                        for (const std::uint32_t f : mesh.triangles[other].edge) shared += e == f;
                    }
                    if (shared == 0) continue;
                    component[other] = name;
                    todo.push_back(other);
                }
            }
        }
        ASSERT_EQ(groups->count(), sizes.size());
        groups_seen += sizes.size();
        // Which group is which component: by a vertex that only one component has.
        std::vector<std::set<int>> components_of(mesh.vertices.size());
        for (std::size_t t = 0; t < triangles; ++t) {
            if (component[t] < 0) continue;
            for (const std::uint32_t v : mesh.triangles[t].vertex) components_of[v].insert(component[t]);
        }
        std::map<int, int> group_of_component;
        for (std::size_t v = 0; v < mesh.vertices.size(); ++v) {
            const std::uint16_t group = groups->group_of(of_vertex[v]);
            EXPECT_EQ(group == kNoGroup, components_of[v].empty());
            if (components_of[v].size() != 1) continue;
            const auto [known, is_new] = group_of_component.insert({*components_of[v].begin(), group});
            EXPECT_EQ(known->second, group) << "a component in two groups";
        }
        for (std::size_t v = 0; v < mesh.vertices.size(); ++v) {
            const std::uint16_t group = groups->group_of(of_vertex[v]);
            for (const int c : components_of[v]) {
                if (group_of_component.count(c) != 0) {
                    EXPECT_LE(group, group_of_component[c]) << "the larger has it";
                }
            }
        }
        for (const auto& [c, g] : group_of_component) {
            for (const auto& [other, h] : group_of_component) {
                if (sizes[static_cast<std::size_t>(other)] > sizes[static_cast<std::size_t>(c)]) {
                    EXPECT_LT(h, g) << "not by size";
                }
            }
        }
        for (std::size_t i = 0; i < scene.correspondences.size(); ++i) {
            if (!scene.correspondences[i].has_depth) {
                EXPECT_EQ(groups->group_of(i), kNoGroup);
            }
        }
        if (HasFailure()) FAIL() << "seed " << seed;
    }
    EXPECT_GT(groups_seen, 200U);
}

// Promise: more groups than the limit: the largest stay, the others are without a group.
TEST(MeshGroups, KeepsTheLargestGroups) {
    Random random(2);
    Scene scene;
    // Nine blocks of random sizes, each with its own motion.
    for (int block = 0; block < 9; ++block) {
        const int side = 2 + static_cast<int>(random.below(5));
        for (int i = 0; i < side * side; ++i) {
            const double x = 20 + 210 * (block % 3) + 20 * (i % side),
                         y = 20 + 160 * (block / 3.0 - block % 3 / 3.0) + 20 * (i / side);
            const Vector3 p = at_pixel(x, y, 2);
            auto c = test::measure(p, p, Noise{}, random);
            c.p_world += Vector3(0, 0, 3.0 * block);
            scene.add(c, block);
        }
    }
    Groups all(limits_of(400)), few(limits_of(400, 3));
    ASSERT_EQ(few.used_bytes(), few.planned_bytes());
    all->build(scene.correspondences, scene.keypoints, {}, context_at(SE3{}));
    few->build(scene.correspondences, scene.keypoints, {}, context_at(SE3{}));
    EXPECT_EQ(all->count(), 9U);
    EXPECT_EQ(few->count(), 3U);
    for (std::size_t i = 0; i < scene.body.size(); ++i) {
        const std::uint16_t wanted = all->group_of(i) < 3 ? all->group_of(i) : kNoGroup;
        EXPECT_EQ(few->group_of(i), wanted);
    }
}

}  // namespace
}  // namespace stillmesh::mesh_groups_test
