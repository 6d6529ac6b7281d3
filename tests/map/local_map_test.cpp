#include "engine/map/local_map.hpp"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <cstdint>
#include <vector>

#include "tests/map/map_rig.hpp"

namespace stillmesh::local_map_test {
namespace {

using test::add_keyframe;
using test::add_point;
using test::MapInMemory;
using test::observation_of;
using test::small;

Handle<MapPoint> add_point_ahead(Map& map, const Vector3& world = {0, 0, 2}, float made_at_m = 2) {
    const Handle<MapPoint> handle = add_point(map);
    store(world, map.points().find(handle)->world);
    map.points().find(handle)->distance_m = made_at_m;
    return handle;
}

// Promise: what is in view is listed although only a keyframe far away observes it; what is behind, beside, or was made
// from much farther or nearer is not, whoever observes it; the view is as wide as the camera's, and a little more.
TEST(LocalMap, ListsAllThatIsInView) {
    MapInMemory map(small(8, 60, 20));
    test::InMemory<LocalMap> local(small(8, 60, 20));
    const Handle<Keyframe> far = add_keyframe(*map, 1);
    map->keyframes().find(far)->world_from_camera.translation = Vector3(50, 0, 0);
    const Handle<Keyframe> here = add_keyframe(*map, 2);
    struct Case {
        Vector3 world;
        float made_at_m;
        bool is_in_view;
    };
    // Created with a cosine of 0.7: 45.6 degrees, and 5.7 more.
    const Case cases[] = {{{0, 0, 2}, 2, true},    {{0, 0, -2}, 2, false},   {{1.9, 0, 2}, 2, true},
                          {{2.35, 0, 2}, 2, true}, {{2.6, 0, 2}, 2, false},  {{0, -2.6, 2}, 2, false},
                          {{0, 0, 2}, 7, false},   {{0, 0, 2}, 0.6F, false}, {{0, 0, 2}, 6, true},
                          {{0, 0, 2}, 0.7F, true}};
    std::vector<Handle<MapPoint>> points;
    for (const Case& one : cases) {
        points.push_back(add_point_ahead(*map, one.world, one.made_at_m));
        map->add_observation(points.size() % 2 == 0 ? far : here, observation_of(points.back()));
    }
    local->build(*map, SE3{});
    for (std::size_t i = 0; i < points.size(); ++i) {
        const auto listed = local->points();
        EXPECT_EQ(std::count(listed.begin(), listed.end(), points[i].slot()), cases[i].is_in_view ? 1 : 0) << i;
    }
}

// Promise: a point is listed up to farther_max times as far, or as near, as where it was made from.
TEST(LocalMap, HowMuchFartherAPointIsListed) {
    const Limits limits = small(8, 60, 20);
    MapInMemory map(limits);
    const Handle<Keyframe> here = add_keyframe(*map, 1);
    for (const float made_at_m : {1.3F, 1.4F, 2.8F, 2.9F}) {  // all 2 m ahead
        map->add_observation(here, observation_of(add_point_ahead(*map, {0, 0, 2}, made_at_m)));
    }
    for (const double farther_max : {1.42, 1.5, 3.0}) {
        ArenaPlan plan;
        LocalMap::plan(plan, limits);
        const test::Memory memory(plan.used_bytes());
        Arena arena(memory.span());
        LocalMapParameters parameters;
        parameters.farther_max = farther_max;
        LocalMap local;
        local.create(arena, limits, parameters);
        local.build(*map, SE3{});
        EXPECT_EQ(local.points().size(), farther_max < 1.45 ? 1U : farther_max < 1.54 ? 3U : 4U) << farther_max;
    }
}

// Promise: the local map lists points once, new ones at once, never more than its limit, and at most half the
// keyframes.
TEST(LocalMap, ListsPointsOnce) {
    Limits limits = small(8, 60, 20);
    limits.local_points_max = 25;
    MapInMemory map(limits);
    test::InMemory<LocalMap> local(limits);
    ASSERT_EQ(local.used_bytes(), local.planned_bytes());
    std::vector<Handle<MapPoint>> points;
    for (int i = 0; i < 40; ++i) points.push_back(add_point_ahead(*map));
    for (std::uint64_t k = 0; k < 8; ++k) {
        const Handle<Keyframe> keyframe = add_keyframe(*map, k + 1);
        for (std::size_t i = 0; i < 12; ++i) map->add_observation(keyframe, observation_of(points[4 * k + i]));
        map->attach(keyframe);
    }
    local->begin_counting();
    local->count(*map, points[5].slot());
    EXPECT_EQ(local->reference(*map).slot(), 0U);
    EXPECT_TRUE(local->is_stale(*map, SE3{}));
    local->build(*map, SE3{});
    EXPECT_FALSE(local->is_stale(*map, SE3{}));
    std::vector<std::uint32_t> listed(local->points().begin(), local->points().end());
    EXPECT_LE(listed.size(), 25U);
    EXPECT_GE(listed.size(), 20U);
    std::sort(listed.begin(), listed.end());
    EXPECT_EQ(std::adjacent_find(listed.begin(), listed.end()), listed.end());
    EXPECT_LE(std::count(local->keyframes().begin(), local->keyframes().end(), 1), 4);
    EXPECT_EQ(local->keyframes()[7], 1U) << "the newest is always local";
    EXPECT_EQ(local->keyframes()[0], 1U) << "it shares the point of the frame";
    const auto size = local->points().size();
    for (int i = 0; i < 2; ++i) local->add(points[39].slot());
    EXPECT_LE(local->points().size(), std::min<std::size_t>(size + 1, 25));
    SE3 away;
    away.translation.x() = 0.2;
    EXPECT_TRUE(local->is_stale(*map, away));
}

// Promise: where more is in view than the list holds, what the local keyframes observe comes first, the rest in the
// order of the pool; a list says the same however often it was built before, and who is spared is who is listed.
TEST(LocalMap, LocalKeyframesComeFirst) {
    Limits limits = small(8, 60, 24);
    limits.local_points_max = 25;
    MapInMemory map(limits);
    test::InMemory<LocalMap> local(limits);
    std::vector<Handle<MapPoint>> points;
    for (int i = 0; i < 40; ++i) points.push_back(add_point_ahead(*map));
    const Handle<Keyframe> far = add_keyframe(*map, 1);
    map->keyframes().find(far)->world_from_camera.translation = Vector3(50, 0, 0);
    const Handle<Keyframe> here = add_keyframe(*map, 2);
    for (std::size_t i = 0; i < 20; ++i) {
        map->add_observation(far, observation_of(points[i]));
        map->add_observation(here, observation_of(points[20 + i]));
    }
    // What shows no point, one that is out of view, or one that is gone, says nothing.
    const Handle<MapPoint> gone = add_point_ahead(*map);
    for (const Handle<MapPoint> point : {Handle<MapPoint>{}, add_point_ahead(*map, {0, 0, -2}), gone})
        map->add_observation(here, observation_of(point));
    map->release_point(gone);
    std::vector<std::uint32_t> expected;
    for (std::size_t i = 20; i < 40; ++i) expected.push_back(points[i].slot());
    for (std::size_t i = 0; i < 5; ++i) expected.push_back(points[i].slot());
    SE3 elsewhere;  // where five other points are in view
    elsewhere.translation.x() = 4;
    for (int i = 0; i < 5; ++i) static_cast<void>(add_point_ahead(*map, {4, 0, 2}));
    for (int round = 0; round < 700; ++round) {  // more than marks have values
        const bool is_crowded = round % 3 != 0;
        local->build(*map, is_crowded ? SE3{} : elsewhere);
        if (!is_crowded) {
            ASSERT_EQ(local->points().size(), 5U);
            continue;
        }
        const std::vector<std::uint32_t> listed(local->points().begin(), local->points().end());
        std::vector<bool> is_listed(60);
        for (const std::uint32_t slot : listed) is_listed[slot] = true;
        for (std::uint32_t slot = 0; slot < 60; ++slot) ASSERT_EQ(local->spared().has(slot), is_listed[slot]) << round;
        ASSERT_EQ(listed, expected) << round;
    }
}

// Promise: local are the newest keyframe, as many as asked for of those that share most with the frame, of those that
// stand nearest, and of the best neighbours of them all, and no others.
TEST(LocalMap, WhoIsLocal) {
    constexpr std::uint32_t kKeyframes = 40;
    const Limits limits = small(2 * kKeyframes, 400, 60);
    MapInMemory map(limits);
    std::vector<Handle<Keyframe>> keyframes;
    for (std::uint32_t k = 0; k < kKeyframes; ++k) {
        keyframes.push_back(add_keyframe(*map, k + 1));
        // 20 to 29 stand near, 25 the nearest; the others elsewhere.
        const double x = k >= 20 && k < 30 ? 0.01 + 0.002 * std::abs(static_cast<double>(k) - 25.1) : 50 + 5.0 * k;
        map->keyframes().find(keyframes.back())->world_from_camera.translation = Vector3(x, 0, 0);
    }
    for (std::uint32_t k = 0; k < 15; ++k) {  // 0 to 14 share points with the frame, 0 the most, 14 a single one
        for (std::uint32_t i = k; i < 15; ++i)
            map->add_observation(keyframes[k], observation_of(add_point_ahead(*map)));
    }
    for (std::uint32_t i = 0; i < 40; ++i) {  // 0 has a neighbour
        const Handle<MapPoint> both = add_point_ahead(*map, {0, 0, -9});
        map->add_observation(keyframes[0], observation_of(both));
        map->add_observation(keyframes[33], observation_of(both));
    }
    const auto local_of = [&](std::uint32_t sharing, std::uint32_t near, std::uint32_t neighbours,
                              Handle<Keyframe> leaves = {}) {
        LocalMapParameters parameters;
        parameters.sharing_keyframes = sharing;
        parameters.near_keyframes = near;
        parameters.neighbours = neighbours;
        ArenaPlan plan;
        LocalMap::plan(plan, limits);
        const test::Memory memory(plan.used_bytes());
        Arena arena(memory.span());
        LocalMap local;
        local.create(arena, limits, parameters);
        local.begin_counting();
        for (std::uint32_t slot = 0; slot < map->points().slots_count(); ++slot) {
            if (map->points().is_taken(slot) && map->points().at(slot).world[2] > 0) local.count(*map, slot);
        }
        if (!leaves.is_null()) map->release_keyframe(leaves);  // between two frames
        local.build(*map, SE3{});
        std::vector<std::uint32_t> out;
        for (std::uint32_t slot = 0; slot < kKeyframes; ++slot) {
            if (local.keyframes()[slot] != 0) out.push_back(slot);
        }
        return out;
    };
    using Slots = std::vector<std::uint32_t>;
    EXPECT_EQ(local_of(1, 0, 0), (Slots{0, 39}));
    EXPECT_EQ(local_of(3, 0, 0), (Slots{0, 1, 2, 39}));
    EXPECT_EQ(local_of(20, 0, 0), (Slots{0, 1, 2, 3, 4, 5, 6, 7, 8, 9, 10, 11, 12, 13, 14, 39}));
    EXPECT_EQ(local_of(1, 1, 0), (Slots{0, 25, 39}));
    EXPECT_EQ(local_of(1, 2, 0), (Slots{0, 25, 26, 39}));
    EXPECT_EQ(local_of(1, 0, 1), (Slots{0, 33, 39}));
    EXPECT_EQ(local_of(5, 5, 0).size(), 11U);
    EXPECT_EQ(local_of(2, 0, 0, keyframes[0]), (Slots{1, 2, 39}))
        << "who has left is not local, however much it shared";
}

}  // namespace
}  // namespace stillmesh::local_map_test
