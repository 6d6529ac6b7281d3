#include "engine/map/map_readout.hpp"

#include <gtest/gtest.h>

#include <cstddef>
#include <cstdint>
#include <span>
#include <tuple>
#include <vector>

#include "engine/map/eviction.hpp"
#include "tests/map/map_rig.hpp"
#include "tests/support/synthetic.hpp"

namespace stillmesh::map_readout_test {
namespace {

// Promise: keyframes are listed with their frames, their parents' and where they lie now, those that were forgotten
// left out; as many as fit, and how many.
TEST(MapReadout, ListsKeyframes) {
    test::MapInMemory map(test::small(8, 50, 20));
    Random random(1);
    std::vector<SE3> poses;
    std::vector<Handle<Keyframe>> keyframes;
    for (std::uint32_t i = 0; i < 5; ++i) {
        keyframes.push_back(test::add_keyframe(*map, 10 * i + 3));
        poses.push_back(test::random_motion(random, 2, 1));
        map->keyframes().find(keyframes[i])->world_from_camera = poses[i];
        map->attach(keyframes[i]);
    }
    map->release_keyframe(keyframes[2]);  // 3 hangs on 1 from now on
    std::vector<KeyframePose> listed(8);
    ASSERT_EQ(list_keyframes(*map, listed), 4U);
    const std::size_t kept[] = {0, 1, 3, 4};
    for (std::size_t i = 0; i < 4; ++i) {
        const std::size_t k = kept[i];
        EXPECT_EQ(listed[i].id, 10 * k + 3);
        const Handle<Keyframe> parent = map->keyframes().find(keyframes[k])->parent;
        EXPECT_EQ(listed[i].parent_id, k == 0 ? kNoKeyframe : map->keyframes().find(parent)->frame);
        SE3 pose;
        Vector4 q;
        for (int n = 0; n < 4; ++n) q(n) = listed[i].map_from_camera.rotation_xyzw[n];
        pose.rotation = Eigen::Quaterniond(q).toRotationMatrix();
        for (int n = 0; n < 3; ++n) pose.translation(n) = listed[i].map_from_camera.translation_m[n];
        EXPECT_LT(test::metres_between(pose, poses[k]), 1e-12);
        EXPECT_LT(test::radians_between(pose, poses[k]), 1e-9);
    }
    EXPECT_EQ(listed[4].id, kNoKeyframe) << "written beyond the count";
    std::vector<KeyframePose> few(3);
    EXPECT_EQ(list_keyframes(*map, few), 3U);
    EXPECT_EQ(few[2].id, 33U);
    EXPECT_EQ(list_keyframes(*map, {}), 0U);
}

// Promise: each keyframe is listed with the older ones that it shares most with, so many as were asked for, none that
// shares less than map.shared_min; as many as fit, and how many.
TEST(MapReadout, ListsCovisible) {
    test::MapInMemory map(test::small(6, 400, 400));
    const std::uint32_t least = map->parameters().shared_min;
    std::vector<Handle<Keyframe>> keyframes;
    for (const std::uint64_t frame : {30U, 10U, 20U, 40U, 50U}) keyframes.push_back(test::add_keyframe(*map, frame));
    const auto share = [&](std::size_t a, std::size_t b, std::uint32_t points) {
        for (std::uint32_t i = 0; i < points; ++i) {
            const Handle<MapPoint> point = test::add_point(*map);
            for (const std::size_t k : {a, b}) map->add_observation(keyframes[k], test::observation_of(point));
        }
    };
    share(0, 1, least);      // 30 and 10
    share(0, 2, least - 1);  // 30 and 20: too few
    share(3, 0, least + 1);  // 40 and 30
    share(3, 1, least + 2);  // 40 and 10
    share(3, 2, least + 2);  // 40 and 20: as many
    share(3, 4, least + 3);  // 50 and 40
    using Pairs = std::vector<std::tuple<std::uint64_t, std::uint64_t, std::uint32_t>>;
    const auto list = [&](std::uint32_t of_each, std::size_t room) {
        std::vector<KeyframeLink> out(room + 1);
        Pairs pairs;
        const std::uint32_t count = list_covisible(*map, of_each, std::span(out).first(room));
        EXPECT_EQ(out[count].older_id, kNoKeyframe) << "written beyond the count";
        for (std::uint32_t i = 0; i < count; ++i) {
            EXPECT_EQ(out[i].kind, KeyframeLinkKind::kCovisible);
            pairs.emplace_back(out[i].older_id, out[i].newer_id, out[i].shared_points);
        }
        return pairs;
    };
    const Pairs all = {
        {10, 30, least}, {30, 40, least + 1}, {10, 40, least + 2}, {20, 40, least + 2}, {40, 50, least + 3}};
    EXPECT_EQ(list(6, 20), all);
    EXPECT_EQ(list(3, 20), all);
    const Pairs two = {{10, 30, least}, {20, 40, least + 2}, {10, 40, least + 2}, {40, 50, least + 3}};
    EXPECT_EQ(list(2, 20), two);
    const Pairs one = {{10, 30, least}, {10, 40, least + 2}, {40, 50, least + 3}};
    EXPECT_EQ(list(1, 20), one);
    EXPECT_EQ(list(1, 3), one);
    EXPECT_EQ(list(1, 2), (Pairs{one[0], one[1]}));
    EXPECT_EQ(list(0, 20), Pairs{});
    EXPECT_EQ(list(6, 0), Pairs{});
    map->release_keyframe(keyframes[3]);
    EXPECT_EQ(list(6, 20), (Pairs{one[0]}));
}

// Promise: the statistics say how full the pools are, were at most and can be, and what went from the map, each by its
// reason and together.
TEST(MapReadout, CountsByReason) {
    test::MapInMemory map(test::small(6, 50, 20));
    for (std::uint32_t i = 0; i < 6; ++i) test::add_keyframe(*map, i);
    evict_oldest(*map);
    evict_oldest(*map);
    release_redundant(*map, map->recent_keyframe(1));
    std::vector<Handle<MapPoint>> points;
    for (int i = 0; i < 30; ++i) points.push_back(test::add_point(*map, 100));
    for (std::size_t i = 0; i < 4; ++i)
        map->points().find(points[i])->last_seen_frame = 0;  // weak, and unseen for long
    cull_points(*map, 90);
    for (std::size_t i = 4; i < 7; ++i) {
        map->release_point(points[i]);
        ++map->statistics().points_emptied;
    }
    map->fuse(points[7], points[8]);
    map->fuse(points[7], points[9]);
    static_cast<void>(make_room_for_points(*map, 5, 1000, {}));
    EngineStatistics s;
    fill_map_statistics(*map, s);
    EXPECT_EQ(s.keyframes_evicted, 2U);
    EXPECT_EQ(s.keyframes_redundant, 1U);
    EXPECT_EQ(s.keyframes_forgotten, 3U);
    EXPECT_EQ(s.points_culled, 4U);
    EXPECT_EQ(s.points_emptied, 3U);
    EXPECT_EQ(s.points_fused, 2U);
    EXPECT_EQ(s.points_evicted, 5U);
    EXPECT_EQ(s.points_forgotten, 14U);
    EXPECT_EQ(s.keyframes.size, 3U);
    EXPECT_EQ(s.keyframes.high_water, 6U);
    EXPECT_EQ(s.keyframes.capacity, 6U);
    EXPECT_EQ(s.map_points.size, 16U);
    EXPECT_EQ(s.map_points.high_water, 30U);
    EXPECT_EQ(s.map_points.capacity, 50U);
}

}  // namespace
}  // namespace stillmesh::map_readout_test
