#include "engine/world/world.hpp"

#include <gtest/gtest.h>

#include <cstdint>

#include "engine/geometry/camera.hpp"
#include "tests/support/small_world.hpp"
#include "tests/support/synthetic.hpp"

namespace stillmesh::world_test {
namespace {

void expect_same(const SE3& a, const SE3& b, double tolerance = 1e-9) {
    EXPECT_LT(test::metres_between(a, b), tolerance);
    EXPECT_LT((a.rotation - b.rotation).cwiseAbs().maxCoeff(), tolerance);
}

// Promise: a world takes the memory it planned, to the byte, knows what it was made with, and begins empty, with the
// noise that is configured.
TEST(World, BeginsAsConfigured) {
    for (const std::uint32_t keyframes : {8U, 40U}) {
        Limits limits = Limits::tiny();
        limits.keyframes_max = keyframes;
        Parameters parameters = test::small_parameters();
        parameters.noise.pixel_start = 0.7;
        parameters.noise.depth_start = 0.9;
        parameters.features.scale_factor = 1.5;
        parameters.map.averaged_max = 4;
        ArenaPlan plan;
        World::plan(plan, limits);
        const test::Memory memory(plan.used_bytes());
        Arena arena(memory.span());
        World world;
        world.create(arena, limits, parameters, test::small_camera());
        EXPECT_EQ(arena.used_bytes(), plan.used_bytes());
        EXPECT_EQ(world.limits.keyframes_max, keyframes);
        EXPECT_EQ(world.map.keyframes().capacity(), keyframes);
        EXPECT_EQ(world.map.points().capacity(), limits.map_points_max);
        EXPECT_EQ(world.map.parameters().averaged_max, 4U);
        EXPECT_EQ(world.keyframe_queue.capacity(), World::kKeyframeQueueMax);
        EXPECT_EQ(world.camera.width, 160U);
        EXPECT_EQ(world.noise.pixel, 0.7);
        EXPECT_EQ(world.noise.depth, 0.9);
        EXPECT_EQ(world.pixel_noise.scale(1), 1.5);
        EXPECT_EQ(world.pose.state, PoseState::kNone);
        EXPECT_FALSE(world.camera_move.is_any);
        EXPECT_FALSE(world.is_frozen);
    }
}

// Promise: a local correction moves the camera and is no jump; one of the whole map moves it and is, is counted, and
// puts the local map out of date. Corrections of both kinds compose, each on the left of those before.
TEST(World, CorrectionsCompose) {
    Random random(1);
    test::SmallWorld world;
    const auto& map = world.map();
    world.add_keyframe(SE3{}, 1);
    SE3 camera, jump;
    for (int round = 0; round < 10'000; ++round) {
        world->local_map.build(map, SE3{});
        EXPECT_FALSE(world->local_map.is_stale(map, SE3{}));
        const SE3 correction = test::random_motion(random, 1, 1);
        const bool is_of_all = random.below(2) == 0;
        const std::uint64_t before = world->corrections;
        if (is_of_all) {
            world->move_everything(correction);
            jump = correction * jump;
            EXPECT_TRUE(world->camera_move.has_jumped);
        } else {
            world->move_camera(correction);
        }
        camera = correction * camera;
        EXPECT_TRUE(world->camera_move.is_any);
        expect_same(world->camera_move.correction, camera, 1e-7);
        expect_same(world->camera_move.jump, jump, 1e-7);
        EXPECT_EQ(world->corrections, before + (is_of_all ? 1 : 0));
        EXPECT_EQ(world->local_map.is_stale(map, SE3{}), is_of_all);
    }
    for (const SE3& all : {world->camera_move.correction, world->camera_move.jump}) {
        EXPECT_LT((all.rotation * all.rotation.transpose() - Matrix3::Identity()).cwiseAbs().maxCoeff(), 3e-15);
    }
    world->camera_move = {};  // tracking has followed
    const SE3 correction = test::random_motion(random, 1, 1);
    world->move_camera(correction);
    EXPECT_FALSE(world->camera_move.has_jumped);
    expect_same(world->camera_move.correction, correction, 0x1p-52);
}

// Promise: after a correction of the map the camera goes with the newest keyframe, and stays where that did not move.
TEST(World, TheCameraFollowsTheNewestKeyframe) {
    Random random(2);
    for (const bool is_moved : {true, false}) {
        test::SmallWorld world;
        const SE3 pose = test::random_motion(random, 1, 1), correction = test::random_motion(random, 1, 1);
        const Handle<Keyframe> newest = world.add_keyframe(pose, 20), older = world.add_keyframe(pose, 10);
        world->map_correction.begin();
        world->map_correction.correct(world.map(), is_moved ? newest : older, pose, correction * pose);
        world->follow_correction();
        EXPECT_EQ(world->corrections, 1U);
        expect_same(world->camera_move.correction, is_moved ? correction : SE3{});
        expect_same(world->camera_move.jump, is_moved ? correction : SE3{});
    }
}

// Promise: reset forgets all that a session gathered, and keeps limits, numbers and camera.
TEST(World, ResetForgetsTheSession) {
    test::SmallWorld world;
    world.add_keyframe(SE3{}, 1);
    world.add_point(Vector3(0, 0, 2));
    ASSERT_TRUE(world->queue_keyframe(world.map().recent_keyframe(0)));
    world->clock = {5, 3, 77};
    world->noise = {9, 9};
    world->pose.state = PoseState::kTracked;
    world->is_frozen = true;
    world->move_everything(se3_exp((Vector6() << 1, 2, 3, 0.1, 0, 0).finished()));
    world->loops_closed = 2;
    world->last_loop = {1, 2, world->camera_move.correction};
    world->local_map.build(world.map(), SE3{});
    const double pixel_start = world->parameters.noise.pixel_start;
    world->reset();
    EXPECT_EQ(world.map().keyframes().size(), 0U);
    EXPECT_EQ(world.map().points().size(), 0U);
    EXPECT_EQ(world->keyframe_queue.size(), 0U);
    EXPECT_EQ(world->clock.frame, 0U);
    EXPECT_EQ(world->clock.first_frame, 0U);
    EXPECT_EQ(world->clock.time_ns, 0);
    EXPECT_EQ(world->noise.pixel, pixel_start);
    EXPECT_EQ(world->noise.depth, world->parameters.noise.depth_start);
    EXPECT_EQ(world->pose.state, PoseState::kNone);
    EXPECT_FALSE(world->is_frozen);
    EXPECT_FALSE(world->camera_move.is_any);
    EXPECT_FALSE(world->camera_move.has_jumped);
    EXPECT_EQ(world->corrections, 0U);
    EXPECT_EQ(world->loops_closed, 0U);
    EXPECT_EQ(world->last_loop.frame_new, 0U);
    EXPECT_TRUE(world->local_map.points().empty());
    EXPECT_EQ(world->limits.features_max, Limits::tiny().features_max);
    EXPECT_EQ(world->camera.fx, test::small_camera().fx);
    EXPECT_EQ(world->parameters.features.count, Limits::tiny().features_max);
}

// Promise: statistics say what waits, has waited at most, and may, and the frames of this session alone.
TEST(World, StatisticsSayWhatWaits) {
    test::SmallWorld world;
    world->clock = {12, 5, 77};
    for (std::uint64_t frame = 1; frame <= 2; ++frame) {
        ASSERT_TRUE(world->queue_keyframe(world.add_keyframe(SE3{}, frame)));
    }
    world->keyframe_queue.pop();
    const EngineStatistics statistics = world->all_statistics();
    EXPECT_EQ(statistics.frames, 7U);
    EXPECT_EQ(statistics.keyframe_queue.size, 1U);
    EXPECT_EQ(statistics.keyframe_queue.high_water, 2U);
    EXPECT_EQ(statistics.keyframe_queue.capacity, World::kKeyframeQueueMax);
    EXPECT_EQ(statistics.keyframes.size, 2U);
}

// Promise: with fewer keyframes than a loop needs there is room for none.
TEST(World, FewKeyframesHoldNoLoop) {
    Limits limits = Limits::tiny();
    for (const std::uint32_t keyframes : {2U, 15U, 16U, 100U}) {
        limits.keyframes_max = keyframes;
        EXPECT_EQ(World::loop_keyframes_max(limits), keyframes < 16 ? 0 : keyframes);
    }
}

}  // namespace
}  // namespace stillmesh::world_test
