#include "engine/static_region/static_region.hpp"
#include "engine/pose/ransac.hpp"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <cstdint>
#include <map>

#include "engine/outputs.hpp"
#include "tests/static_region/scenes.hpp"
#include "tests/support/memory.hpp"

namespace stillmesh::static_region_test {
namespace {

using namespace test;
using Region = InMemory<StaticRegion>;

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
        std::size_t in_largest = 0;
        for (std::size_t i = 0; i < scene.body.size(); ++i) in_largest += region->group_of(i) == 0 ? 1U : 0U;
        EXPECT_GE(in_largest, 285U) << "seed " << seed;
        const RegionChoice choice = region->choose(scene.correspondences, Parameters{}, context, random);
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
        const RegionChoice choice = region->choose(scene.correspondences, Parameters{}, context, random);
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

// Promise: the room is told to be explained by the choice and by no rival, a body that moved and votes by the rival and
// not by the choice; the shares are about those of their surfaces. A room with nobody in it has no rival, and the paper
// tells none.
TEST(StaticRegion, TellsWhatOnlyTheRivalExplains) {
    std::size_t by[2][4] = {};  // body, bits
    for (std::uint64_t seed = 0; seed < 20; ++seed) {
        Random random(seed);
        const SE3 pose = test::random_motion(random, 0.5, 0.3);
        SE3 motion;
        motion.translation = test::random_vector(random, 1.0).normalized() * random.uniform(0.06, 0.1);
        const Scene scene = room_and_body(seed % 4 == 0 ? 300 : 150, seed % 4 == 0 ? 0 : 250, pose, motion, random);
        Region region(limits_of(400));
        Parameters parameters;
        if (seed % 4 == 1) parameters.region.method = static_cast<std::uint32_t>(RegionMethod::kPaper);
        const RegionContext context = context_at(pose * test::random_motion(random, 0.005, 0.005));
        region->build(scene.correspondences, scene.keypoints, parameters.region, context);
        const RegionChoice choice = region->choose(scene.correspondences, parameters, context, random);
        ASSERT_TRUE(choice.is_valid) << seed;
        double share[2] = {0, 0}, area_all = 0;
        for (std::size_t i = 0; i < scene.body.size(); ++i) {
            const unsigned bits = region->explained_by(choice, i);
            ASSERT_LT(bits, 4U);
            EXPECT_TRUE(seed % 4 != 1 || bits == 0) << seed;
            EXPECT_TRUE(seed % 4 != 0 || (bits & TrackingView::kByRival) == 0) << seed;
            if (seed % 4 > 1) ++by[scene.body[i]][bits];
            const Correspondence& c = scene.correspondences[i];
            const double area = c.has_depth ? c.extent * c.p_camera.z() * c.p_camera.z() : 0.0;
            area_all += area;
            for (const unsigned k : {0U, 1U}) share[k] += (bits >> k & 1U) != 0 ? area : 0.0;
        }
        if (seed % 4 == 1) continue;
        EXPECT_NEAR(choice.rival.chosen_share, share[0] / area_all, 1e-9) << seed;
        EXPECT_NEAR(choice.rival.share, share[1] / area_all, 1e-9) << seed;
    }
    EXPECT_GT(by[0][TrackingView::kByChoice], 4 * (by[0][0] + by[0][2] + by[0][3]));
    EXPECT_GT(by[1][TrackingView::kByRival], 4 * (by[1][0] + by[1][1] + by[1][3]));
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
        ASSERT_TRUE(region->choose(scene.correspondences, Parameters{}, context, random).is_valid);
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
            if (scene.body[i] == 1) scene.correspondences[i].weight = 0.03;
        }
        Region region(limits_of(300));
        const RegionContext context = context_at(pose * test::random_motion(random, 0.01, 0.01));
        region->build(scene.correspondences, scene.keypoints, {}, context);
        const RegionChoice choice = region->choose(scene.correspondences, Parameters{}, context, random);
        ASSERT_TRUE(choice.is_valid);
        EXPECT_LT(test::metres_between(choice.world_from_camera, pose), 0.015) << seed;
        std::size_t wrong = 0;
        for (const std::uint16_t i : region->chosen()) wrong += scene.body[i] == 1;
        EXPECT_LE(wrong, 6U) << seed;
    }
}

// Promise: weights count by the area in the room that a feature stands for, not by number or by pixels: a body at arm's
// length with most of the features and most of the picture does not outvote the wall behind it, hardly by
// triangles, by them alone, or by both; and the choice says that it is sure.
TEST(StaticRegion, AreaInTheRoomOutvotesPixels) {
    for (const double by_points : {100.0, 0.0, 0.5}) {
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
            Parameters configuration;
            configuration.region.score_points = by_points;
            RegionContext context = context_at(pose);
            context.has_prediction = false;  // nothing but the weights decides
            Region region(limits_of(300));
            region->build(scene.correspondences, scene.keypoints, configuration.region, context);
            const RegionChoice choice = region->choose(scene.correspondences, configuration, context, random);
            ASSERT_TRUE(choice.is_valid);
            EXPECT_LT(test::metres_between(choice.world_from_camera, pose), 0.05)
                << "seed " << seed << " points " << by_points;
            EXPECT_GT(choice.margin, 0.5) << "seed " << seed;
        }
    }
}

// Promise: points without a weight are never chosen, whatever they agree with.
TEST(StaticRegion, NoVoteNoChoice) {
    Random random(3);
    const SE3 pose = test::random_motion(random, 0.5, 0.3);
    Scene scene = room_and_body(200, 0, pose, SE3{}, random);
    for (std::size_t i = 0; i < 100; ++i) scene.correspondences[i].weight = 0;
    Region region(limits_of(300));
    region->build(scene.correspondences, scene.keypoints, {}, context_at(pose));
    const RegionChoice choice = region->choose(scene.correspondences, Parameters{}, context_at(pose), random);
    ASSERT_TRUE(choice.is_valid);
    for (const std::uint16_t i : region->chosen()) EXPECT_GE(i, 100U);
    for (const std::uint16_t i : region->weighted()) EXPECT_GE(i, 100U);
    EXPECT_EQ(region->weighted().size(), 100U);
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
        Parameters configuration;
        configuration.pose.coarse_total_max = 1 + random.below(seed < 20 ? 10 : 300);
        configuration.pose.coarse_factor = 1 + random.below(3);
        if (seed % 4 < 2) {  // chaos in one group
            configuration.region.edge_change_max_m = 5;
            configuration.region.edge_chi2_max = 1000;
        }
        region->build(scene.correspondences, scene.keypoints, configuration.region, context_at(SE3{}));
        const RegionChoice choice = region->choose(scene.correspondences, configuration, context_at(SE3{}), random);
        EXPECT_LE(choice.iterations,
                  configuration.pose.coarse_total_max +
                      ransac_options(configuration, configuration.pose.coarse_factor, 0.5).iterations_max);
    }
}

// Promise: a body that fills the picture is followed where nothing else is known, and not where wheels say that the
// camera stood still: what they say is looked at as it is, however much better the body fits.
TEST(StaticRegion, WhatIsHintedAtIsLookedAt) {
    std::size_t followed = 0;
    for (std::uint64_t seed = 0; seed < 10; ++seed) {
        Random random(seed);
        const SE3 pose = test::random_motion(random, 0.5, 0.3);
        SE3 motion;
        motion.translation = Vector3(0.08, 0, 0);
        const Scene scene = room_and_body(12, 285, pose, motion, random);
        for (const bool is_hinted : {false, true}) {
            RegionContext context = context_at(pose);
            context.has_prediction = is_hinted;
            context.hint.is_any = context.hint.is_whole = is_hinted;
            context.prediction_sigma_m = context.prediction_sigma_rad = 0.002;
            Region region(limits_of(300));
            region->build(scene.correspondences, scene.keypoints, {}, context);
            const RegionChoice choice = region->choose(scene.correspondences, Parameters{}, context, random);
            ASSERT_TRUE(choice.is_valid) << seed;
            const double with_body_m = test::metres_between(choice.world_from_camera, motion * pose);
            if (!is_hinted) {
                followed += with_body_m < 0.02 ? 1U : 0U;
                continue;
            }
            EXPECT_LT(test::metres_between(choice.world_from_camera, pose), 0.02) << seed;
            std::size_t wrong = 0;
            for (const std::uint16_t i : region->chosen()) wrong += scene.body[i] == 1;
            EXPECT_LE(wrong, 13U) << seed << ": of 285";
        }
    }
    EXPECT_GE(followed, 5U) << "else it does not fill the picture";
}

// Promise: where neither points nor triangles nor an expectation have a say, there is a score of nothing, not a
// division by it.
TEST(StaticRegion, NothingHasASay) {
    Random random(9);
    Scene scene;  // on a line in the picture: no triangle
    for (int i = 0; i < 40; ++i) {
        const Vector3 p = at_pixel(20 + 10 * i, 240, random.uniform(1, 3));
        scene.add(test::measure(p, p, Noise{}, random), 0);
    }
    Parameters configuration;
    configuration.region.score_points = 0;
    RegionContext context = context_at(SE3{});
    context.has_prediction = false;
    Region region(limits_of(50));
    region->build(scene.correspondences, scene.keypoints, configuration.region, context);
    const RegionChoice choice = region->choose(scene.correspondences, configuration, context, random);
    EXPECT_EQ(choice.score, 0);
    EXPECT_TRUE(test::is_finite(choice.world_from_camera));
}

// Promise: nothing, next to nothing, lines, one place, no depth, no weights: no valid choice, no crash, no NaN.
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
    for (Correspondence& c : none.back().correspondences) c.weight = 0;
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
                const RegionChoice choice = region->choose(scene.correspondences, Parameters{}, context, random);
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
    static_cast<void>(used->choose(other.correspondences, Parameters{}, context_at(SE3{}), random));
    Random a(7), b(7);
    fresh->build(scene.correspondences, scene.keypoints, {}, context_at(pose));
    used->build(scene.correspondences, scene.keypoints, {}, context_at(pose));
    const RegionChoice first = fresh->choose(scene.correspondences, Parameters{}, context_at(pose), a);
    const RegionChoice second = used->choose(scene.correspondences, Parameters{}, context_at(pose), b);
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
}  // namespace stillmesh::static_region_test
