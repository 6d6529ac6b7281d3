#include "engine/static_region/static_region.hpp"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <cstdint>
#include <map>
#include <set>
#include <vector>

#include "engine/static_region/distance_consistency.hpp"
#include "tests/support/memory.hpp"
#include "tests/support/synthetic.hpp"

namespace stillmesh {
namespace {

using test::Noise;
using Region = test::InMemory<StaticRegion>;

constexpr double kFocal_px = 500, kCentreX = 320, kCentreY = 240;

Limits limits_of(std::uint32_t features, std::uint32_t groups = 64) {
    Limits limits;
    limits.features_max = features;
    limits.groups_max = groups;
    return limits;
}

// Correspondences with the pixels they were seen at.
struct Scene {
    std::vector<Correspondence> correspondences;
    std::vector<Keypoint> keypoints;
    std::vector<int> body;  // 0: the room

    void add(Correspondence c, int of_body) {
        Keypoint keypoint;
        keypoint.x = static_cast<float>(c.normalised.x() * kFocal_px + kCentreX);
        keypoint.y = static_cast<float>(c.normalised.y() * kFocal_px + kCentreY);
        c.feature = static_cast<std::uint32_t>(keypoints.size());
        c.point_slot = c.feature;
        correspondences.push_back(c);
        keypoints.push_back(keypoint);
        body.push_back(of_body);
    }
    [[nodiscard]] std::size_t count(int of_body) const {
        return static_cast<std::size_t>(std::count(body.begin(), body.end(), of_body));
    }
};

Vector3 at_pixel(double x, double y, double z) {
    return {(x - kCentreX) / kFocal_px * z, (y - kCentreY) / kFocal_px * z, z};
}

const Noise kKinect{0.8e-3, 1.425e-3, 0};

// The room behind, seen from `pose`, and a body before it, in a rectangle of the image, that moved by `motion` since.
Scene room_and_body(std::uint32_t room_points, std::uint32_t body_points, const SE3& pose, const SE3& motion,
                    Random& random) {
    Scene scene;
    while (scene.count(0) < room_points) {
        const double x = random.uniform(10, 630), y = random.uniform(10, 470);
        if (body_points > 0 && x > 210 && x < 410 && y > 110) continue;
        const Vector3 p = at_pixel(x, y, 2.6 + 0.001 * x + 0.05 * std::sin(0.02 * y));
        scene.add(test::measure(p, pose * p, kKinect, random), 0);
    }
    while (scene.count(1) < body_points) {
        const double x = random.uniform(220, 400), y = random.uniform(120, 470);
        const Vector3 p = at_pixel(x, y, 1.3 + 0.05 * std::sin(0.03 * x));
        scene.add(test::measure(p, motion * (pose * p), kKinect, random), 1);
    }
    return scene;
}

RegionContext context_at(const SE3& pose) {
    RegionContext context;
    context.world_from_camera_predicted = pose;
    context.prediction_sigma_m = 0.02;
    context.prediction_sigma_rad = 0.02;
    context.has_prediction = true;
    return context;
}

double area_px2(const Mesh& mesh, const MeshTriangle& t) {
    const auto x = [&](int k) { return static_cast<double>(mesh.vertices[t.vertex[k]].x) / kMeshUnitsPerPixel; };
    const auto y = [&](int k) { return static_cast<double>(mesh.vertices[t.vertex[k]].y) / kMeshUnitsPerPixel; };
    return 0.5 * std::abs((x(1) - x(0)) * (y(2) - y(0)) - (y(1) - y(0)) * (x(2) - x(0)));
}

// Promise: edges are kept by the distance test alone; groups are what whole triangles connect through shared edges,
// numbered by descending size, a shared vertex in the larger; points, area and score (Eq. 1) are those of the group.
TEST(StaticRegion, GroupsEqualBruteForce) {
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
        Region region(limits_of(400));
        const RegionParameters parameters;
        const RegionContext context = context_at(pose);
        region->build(scene.correspondences, scene.keypoints, parameters, context);
        const Mesh& mesh = region->mesh();
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
            ASSERT_EQ(region->is_kept(i), keeps);
            kept += keeps ? 1U : 0U;
        }
        EXPECT_EQ(region->kept_count(), kept);
        // Flood over whole triangles.
        const std::size_t triangles = mesh.triangles.size();
        const auto is_whole = [&](std::size_t t) {
            return std::all_of(std::begin(mesh.triangles[t].edge), std::end(mesh.triangles[t].edge),
                               [&](std::uint32_t e) { return region->is_kept(e); });
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
        ASSERT_EQ(region->groups_count(), sizes.size());
        groups_seen += sizes.size();
        // Which group is which component: by a vertex that only one component has.
        std::vector<std::set<int>> components_of(mesh.vertices.size());
        for (std::size_t t = 0; t < triangles; ++t) {
            if (component[t] < 0) continue;
            for (const std::uint32_t v : mesh.triangles[t].vertex) components_of[v].insert(component[t]);
        }
        std::vector<double> area(sizes.size());
        double area_all = 0;
        for (std::size_t t = 0; t < triangles; ++t) {
            area_all += area_px2(mesh, mesh.triangles[t]);
            if (component[t] >= 0) area[static_cast<std::size_t>(component[t])] += area_px2(mesh, mesh.triangles[t]);
        }
        std::map<int, int> group_of_component;
        for (std::size_t v = 0; v < mesh.vertices.size(); ++v) {
            const std::uint16_t group = region->group_of(of_vertex[v]);
            EXPECT_EQ(group == kNoGroup, components_of[v].empty());
            if (components_of[v].size() != 1) continue;
            const auto [known, is_new] = group_of_component.insert({*components_of[v].begin(), group});
            EXPECT_EQ(known->second, group) << "a component in two groups";
        }
        std::vector<std::uint32_t> points(sizes.size());
        for (std::size_t v = 0; v < mesh.vertices.size(); ++v) {
            const std::uint16_t group = region->group_of(of_vertex[v]);
            if (group == kNoGroup) continue;
            ++points[group];
            for (const int c : components_of[v]) {
                if (group_of_component.count(c) != 0) {
                    EXPECT_LE(group, group_of_component[c]) << "the larger has it";
                }
            }
        }
        for (const auto& [c, g] : group_of_component) {
            const Group& group = region->group(static_cast<std::size_t>(g));
            const auto name = static_cast<std::size_t>(c);
            EXPECT_NEAR(group.area_px2, area[name], 1e-6);
            EXPECT_EQ(group.points, points[static_cast<std::size_t>(g)]);
            const double wanted = 0.5 * group.points / static_cast<double>(with_depth.size()) + area[name] / area_all;
            EXPECT_NEAR(group.score, wanted, 1e-12);
            for (const auto& [other, h] : group_of_component) {
                if (sizes[static_cast<std::size_t>(other)] > sizes[name]) {
                    EXPECT_LT(h, g) << "not by size";
                }
            }
        }
        for (std::size_t i = 0; i < scene.correspondences.size(); ++i) {
            if (!scene.correspondences[i].has_depth) {
                EXPECT_EQ(region->group_of(i), kNoGroup);
            }
        }
        if (HasFailure()) FAIL() << "seed " << seed;
    }
    EXPECT_GT(groups_seen, 200U);
}

// Promise: Eq. 1 by hand: two squares of 100 px, 200 px apart, that moved apart.
TEST(StaticRegion, ScoreByHand) {
    Random random(1);
    Scene scene;
    for (const double left : {100.0, 400.0}) {
        for (const auto& [dx, dy] : {std::pair{0.0, 0.0}, {100.0, 0.0}, {0.0, 100.0}, {100.0, 101.0}}) {
            const Vector3 p = at_pixel(left + dx, 100 + dy, 2);
            auto c = test::measure(p, p, Noise{}, random);
            if (left > 300) c.p_world += Vector3(0, 0, 5);
            scene.add(c, left > 300);
        }
    }
    Region region(limits_of(50));
    RegionParameters parameters;
    region->build(scene.correspondences, scene.keypoints, parameters, context_at(SE3{}));
    ASSERT_EQ(region->groups_count(), 2U);
    // The hull: (100, 100), (500, 100), (500, 201), (200, 201), (100, 200).
    const double all = 10050 + 300 * 101;
    for (std::size_t g = 0; g < 2; ++g) {
        EXPECT_EQ(region->group(g).points, 4U);
        EXPECT_NEAR(region->group(g).area_px2, 10050, 1e-9);
        EXPECT_NEAR(region->group(g).score, 0.5 * 4 / 8 + 1.0 * 10050 / all, 1e-12);
    }
    EXPECT_NE(region->group_of(0), region->group_of(4));
    parameters.score_points = 0;
    parameters.score_area = 2;
    region->build(scene.correspondences, scene.keypoints, parameters, context_at(SE3{}));
    EXPECT_NEAR(region->group(0).score, 2.0 * 10050 / all, 1e-12);
}

// Promise: more groups than the limit: the largest stay, the others are without a vote, nothing breaks.
TEST(StaticRegion, KeepsTheLargestGroups) {
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
    Region all(limits_of(400)), few(limits_of(400, 3));
    ASSERT_EQ(few.used_bytes(), few.planned_bytes());
    all->build(scene.correspondences, scene.keypoints, {}, context_at(SE3{}));
    few->build(scene.correspondences, scene.keypoints, {}, context_at(SE3{}));
    EXPECT_EQ(all->groups_count(), 9U);
    EXPECT_EQ(few->groups_count(), 3U);
    for (std::size_t i = 0; i < scene.body.size(); ++i) {
        const std::uint16_t wanted = all->group_of(i) < 3 ? all->group_of(i) : kNoGroup;
        EXPECT_EQ(few->group_of(i), wanted);
    }
    static_cast<void>(few->choose(scene.correspondences, Configuration{}, context_at(SE3{}), random));
}

// Promise: a room with nobody in it is one group, nearly all of it is accepted, and the choice is sure.
TEST(StaticRegion, OneBodyIsOneGroup) {
    for (std::uint64_t seed = 0; seed < 20; ++seed) {
        Random random(seed);
        const SE3 pose = test::random_motion(random, 0.5, 0.3);
        const Scene scene = room_and_body(300, 0, pose, SE3{}, random);
        Region region(limits_of(300));
        const RegionContext context = context_at(pose * test::random_motion(random, 0.01, 0.01));
        region->build(scene.correspondences, scene.keypoints, {}, context);
        ASSERT_GE(region->groups_count(), 1U);
        EXPECT_GE(region->group(0).points, 285U) << "seed " << seed;
        const RegionChoice choice = region->choose(scene.correspondences, Configuration{}, context, random);
        ASSERT_TRUE(choice.is_valid);
        EXPECT_GE(region->chosen().size(), 280U);
        EXPECT_LT(test::metres_between(choice.world_from_camera, pose), 0.006);
        EXPECT_LT(test::radians_between(choice.world_from_camera, pose), 0.004);
        EXPECT_GT(choice.margin, 0.9);
        EXPECT_GT(choice.score, 0.8);
    }
}

// Promise: a body that has moved is told from the room: hardly ever does a group join them, the room is chosen, next to
// none of the body is accepted, most of the room is, and the pose is that of the camera, not of the body.
TEST(StaticRegion, TwoBodiesMovingApartAreSeparated) {
    std::size_t accepted_moving = 0, moving = 0, accepted_still = 0, still = 0, joined = 0;
    for (std::uint64_t seed = 0; seed < 30; ++seed) {
        Random random(seed);
        const SE3 pose = test::random_motion(random, 0.5, 0.3);
        SE3 motion;
        motion.translation = test::random_vector(random, 1.0).normalized() * random.uniform(0.06, 0.2);
        const Scene scene = room_and_body(180, 100, pose, motion, random);
        Region region(limits_of(300));
        const RegionContext context = context_at(pose * test::random_motion(random, 0.01, 0.01));
        region->build(scene.correspondences, scene.keypoints, {}, context);
        std::map<int, std::size_t> in_group[2];
        for (std::size_t i = 0; i < scene.body.size(); ++i) {
            if (region->group_of(i) != kNoGroup) ++in_group[scene.body[i]][region->group_of(i)];
        }
        for (const auto& [group, count] : in_group[0]) joined += std::min(count, in_group[1][group]) > 2;
        const RegionChoice choice = region->choose(scene.correspondences, Configuration{}, context, random);
        ASSERT_TRUE(choice.is_valid) << seed;
        EXPECT_LT(test::metres_between(choice.world_from_camera, pose), 0.01) << seed;
        EXPECT_LT(test::radians_between(choice.world_from_camera, pose), 0.006) << seed;
        EXPECT_GT(choice.margin, 0.0) << seed;
        for (const std::uint16_t i : region->chosen()) {
            accepted_moving += scene.body[i] == 1;
            accepted_still += scene.body[i] == 0;
        }
        moving += scene.count(1);
        still += scene.count(0);
    }
    EXPECT_LE(joined, 2U);  // a long triangle along the border may change by less than its noise: motions decide then
    EXPECT_LE(static_cast<double>(accepted_moving), 0.01 * static_cast<double>(moving));
    EXPECT_GE(static_cast<double>(accepted_still), 0.9 * static_cast<double>(still));
}

// Promise: how far a group agrees with the choice can be asked: a body that moved by five millimetres does not, the
// room does, and who was given no motion of his own is not judged.
TEST(StaticRegion, AgreementTellsWhoMoved) {
    for (std::uint64_t seed = 0; seed < 20; ++seed) {
        Random random(seed);
        const SE3 pose = test::random_motion(random, 0.5, 0.3);
        SE3 motion;
        motion.translation = pose.rotation * Vector3(0.005, 0, 0);
        const Scene scene = room_and_body(250, 150, pose, motion, random);
        Region region(limits_of(400));
        const RegionContext context = context_at(pose * test::random_motion(random, 0.01, 0.01));
        region->build(scene.correspondences, scene.keypoints, {}, context);
        ASSERT_TRUE(region->choose(scene.correspondences, Configuration{}, context, random).is_valid);
        double agreement[2] = {0, 0};
        for (std::size_t i = 0; i < scene.body.size(); ++i) {
            agreement[scene.body[i]] += region->agreement_of(region->group_of(i));
        }
        EXPECT_LT(agreement[1], 0.1 * static_cast<double>(scene.count(1))) << seed;
        EXPECT_GT(agreement[0], 0.75 * static_cast<double>(scene.count(0))) << seed;
        EXPECT_EQ(region->agreement_of(kNoGroup), 1.0);
        EXPECT_EQ(region->agreement_of(static_cast<std::uint16_t>(region->groups_count())), 1.0);
    }
}

// Promise: what the past knows counts for more than numbers: a crowd that has no past does not outvote the room.
TEST(StaticRegion, ThePastOutvotesTheCrowd) {
    for (std::uint64_t seed = 0; seed < 20; ++seed) {
        Random random(seed);
        const SE3 pose = test::random_motion(random, 0.5, 0.3);
        SE3 motion;
        motion.translation = test::random_vector(random, 1.0).normalized() * random.uniform(0.05, 0.1);
        Scene scene = room_and_body(80, 220, pose, motion, random);
        for (std::size_t i = 0; i < scene.body.size(); ++i) {
            if (scene.body[i] == 1) scene.correspondences[i].vote = 0.03;
        }
        Region region(limits_of(300));
        const RegionContext context = context_at(pose * test::random_motion(random, 0.01, 0.01));
        region->build(scene.correspondences, scene.keypoints, {}, context);
        const RegionChoice choice = region->choose(scene.correspondences, Configuration{}, context, random);
        ASSERT_TRUE(choice.is_valid);
        EXPECT_LT(test::metres_between(choice.world_from_camera, pose), 0.015) << seed;
        std::size_t wrong = 0;
        for (const std::uint16_t i : region->chosen()) wrong += scene.body[i] == 1;
        EXPECT_LE(wrong, 6U) << seed;
    }
}

// Promise: votes count by the area in the room that a feature stands for, not by number or by pixels: a body at arm's
// length with most of the features and most of the picture does not outvote the wall behind it, by points alone, by
// triangles alone, or by both; and the choice says that it is sure.
TEST(StaticRegion, AreaInTheRoomOutvotesPixels) {
    for (const auto& [by_points, by_area] : {std::pair{1.0, 0.0}, std::pair{0.0, 1.0}, std::pair{0.5, 1.0}}) {
        for (std::uint64_t seed = 0; seed < 10; ++seed) {
            Random random(seed);
            const SE3 pose = test::random_motion(random, 0.5, 0.3);
            SE3 motion;
            motion.translation = test::random_vector(random, 1.0).normalized() * 0.15;
            Scene scene;
            while (scene.count(0) < 110) {  // a quarter of the picture
                const Vector3 p = at_pixel(random.uniform(10, 180), random.uniform(10, 470), 3.2);
                scene.add(test::measure(p, pose * p, kKinect, random), 0);
            }
            while (scene.count(1) < 190) {
                const double x = random.uniform(220, 630);
                const Vector3 p = at_pixel(x, random.uniform(10, 470), 0.9 + 0.05 * std::sin(0.03 * x));
                scene.add(test::measure(p, motion * (pose * p), kKinect, random), 1);
            }
            Configuration configuration;
            configuration.region.score_points = by_points;
            configuration.region.score_area = by_area;
            RegionContext context = context_at(pose);
            context.has_prediction = false;  // nothing but the votes decides
            Region region(limits_of(300));
            region->build(scene.correspondences, scene.keypoints, configuration.region, context);
            const RegionChoice choice = region->choose(scene.correspondences, configuration, context, random);
            ASSERT_TRUE(choice.is_valid);
            EXPECT_LT(test::metres_between(choice.world_from_camera, pose), 0.05)
                << "seed " << seed << " points " << by_points << " area " << by_area;
            EXPECT_GT(choice.margin, 0.5) << "seed " << seed;
        }
    }
}

// Promise: points without a vote are never chosen, whatever they agree with.
TEST(StaticRegion, NoVoteNoChoice) {
    Random random(3);
    const SE3 pose = test::random_motion(random, 0.5, 0.3);
    Scene scene = room_and_body(200, 0, pose, SE3{}, random);
    for (std::size_t i = 0; i < 100; ++i) scene.correspondences[i].vote = 0;
    Region region(limits_of(300));
    region->build(scene.correspondences, scene.keypoints, {}, context_at(pose));
    const RegionChoice choice = region->choose(scene.correspondences, Configuration{}, context_at(pose), random);
    ASSERT_TRUE(choice.is_valid);
    for (const std::uint16_t i : region->chosen()) EXPECT_GE(i, 100U);
    for (const std::uint16_t i : region->voters()) EXPECT_GE(i, 100U);
    EXPECT_EQ(region->voters().size(), 100U);
}

// Promise: hypotheses keep their caps, whatever the scene: all groups together theirs, RANSAC over all its own.
TEST(StaticRegion, IterationsAreBounded) {
    for (std::uint64_t seed = 0; seed < 40; ++seed) {
        Random random(seed);
        Scene scene;
        for (int i = 0; i < 300; ++i) {  // chaos: nothing agrees with anything for long
            const Vector3 p = test::random_point_in_view(random, 2.0, 2.1);
            const double far = seed % 2 == 0 ? 0.02 : 0.5;
            scene.add(test::measure(p, p + test::random_vector(random, far), kKinect, random), 0);
        }
        Region region(limits_of(300));
        Configuration configuration;
        configuration.pose.coarse_total_max = 1 + random.below(seed < 20 ? 10 : 300);
        configuration.pose.coarse_iterations_max = 30 + random.below(seed < 20 ? 30 : 300);
        if (seed % 4 < 2) {  // chaos in one group
            configuration.region.edge_change_max_m = 5;
            configuration.region.edge_chi2_max = 1000;
        }
        region->build(scene.correspondences, scene.keypoints, configuration.region, context_at(SE3{}));
        const RegionChoice choice = region->choose(scene.correspondences, configuration, context_at(SE3{}), random);
        EXPECT_LE(choice.iterations, configuration.pose.coarse_total_max + configuration.pose.coarse_iterations_max);
    }
}

// Promise: nothing, next to nothing, lines, one place, no depth, no votes: no valid choice, no crash, no NaN.
TEST(StaticRegion, DegenerateInputGivesNoChoice) {
    Random random(4);
    const SE3 pose = test::random_motion(random, 0.5, 0.3);
    const auto scene_of = [&](int count, auto&& point) {
        Scene scene;
        for (int i = 0; i < count; ++i) {
            const Vector3 p = point(i);
            scene.add(test::measure(p, pose * p, Noise{}, random), 0);
        }
        return scene;
    };
    const auto anywhere = [&](int) { return test::random_point_in_view(random); };
    std::vector<Scene> none;
    for (const int count : {0, 1, 2}) none.push_back(scene_of(count, anywhere));
    none.push_back(scene_of(50, anywhere));
    for (Correspondence& c : none.back().correspondences) c.vote = 0;
    std::vector<Scene> maybe;
    for (const int count : {3, 4, 5}) maybe.push_back(scene_of(count, anywhere));
    maybe.push_back(scene_of(50, [](int) { return Vector3(0.1, 0.2, 2.0); }));
    maybe.push_back(scene_of(50, [](int i) { return Vector3(0.01 * i, 0.005 * i, 1 + 0.02 * i); }));
    maybe.push_back(scene_of(50, anywhere));
    for (Correspondence& c : maybe.back().correspondences) c.has_depth = false;
    Region region(limits_of(50));
    for (const bool has_prediction : {false, true}) {
        RegionContext context = context_at(pose);
        context.has_prediction = has_prediction;
        for (const auto* const scenes : {&none, &maybe}) {
            for (const Scene& scene : *scenes) {
                region->build(scene.correspondences, scene.keypoints, {}, context);
                const RegionChoice choice = region->choose(scene.correspondences, Configuration{}, context, random);
                if (scenes == &none) {
                    EXPECT_FALSE(choice.is_valid) << scene.body.size();
                }
                EXPECT_TRUE(test::is_finite(choice.world_from_camera));
                EXPECT_TRUE(std::isfinite(choice.score));
                EXPECT_TRUE(std::isfinite(choice.margin));
                EXPECT_TRUE(choice.explained_share >= 0 && choice.explained_share <= 1);
                EXPECT_LE(region->chosen().size(), scene.body.size());
            }
        }
    }
}

// Promise: same input, same bits, whatever was in the room before.
TEST(StaticRegion, IsDeterministic) {
    Random random(5);
    const SE3 pose = test::random_motion(random, 0.5, 0.3);
    SE3 motion;
    motion.translation = Vector3(0.1, 0, 0.02);
    const Scene scene = room_and_body(180, 100, pose, motion, random);
    const Scene other = room_and_body(250, 0, pose, SE3{}, random);
    Region fresh(limits_of(300)), used(limits_of(300));
    used->build(other.correspondences, other.keypoints, {}, context_at(SE3{}));
    static_cast<void>(used->choose(other.correspondences, Configuration{}, context_at(SE3{}), random));
    Random a(7), b(7);
    fresh->build(scene.correspondences, scene.keypoints, {}, context_at(pose));
    used->build(scene.correspondences, scene.keypoints, {}, context_at(pose));
    const RegionChoice first = fresh->choose(scene.correspondences, Configuration{}, context_at(pose), a);
    const RegionChoice second = used->choose(scene.correspondences, Configuration{}, context_at(pose), b);
    EXPECT_EQ(first.world_from_camera.rotation, second.world_from_camera.rotation);
    EXPECT_EQ(first.world_from_camera.translation, second.world_from_camera.translation);
    EXPECT_EQ(first.score, second.score);
    EXPECT_EQ(first.margin, second.margin);
    EXPECT_EQ(first.iterations, second.iterations);
    ASSERT_TRUE(
        std::equal(fresh->chosen().begin(), fresh->chosen().end(), used->chosen().begin(), used->chosen().end()));
    EXPECT_EQ(a.next(), b.next());
}

}  // namespace
}  // namespace stillmesh
