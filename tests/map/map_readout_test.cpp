#include "engine/map/map_readout.hpp"

#include <gtest/gtest.h>

#include <cstdint>
#include <span>

#include "tests/map/map_rig.hpp"

namespace stillmesh {
namespace {

using test::add_keyframe;
using test::add_point;
using test::MapInMemory;
using test::observation_of;
using test::small;

// Promise: programs see every keyframe with its parent, as many as they have room for, how full the pools are and were,
// and what went and why.
TEST(MapReadout, ListsTheMap) {
    MapInMemory map(small(4, 20, 6));
    const Handle<Keyframe> first = add_keyframe(*map, 10), second = add_keyframe(*map, 20);
    map->keyframes().find(second)->world_from_camera.translation.x() = 2;
    for (int i = 0; i < 5; ++i) map->add_observation(second, observation_of(add_point(*map)));
    map->attach(first);
    map->attach(second);
    KeyframePose listed[3];
    ASSERT_EQ(list_keyframes(*map, listed), 2U);
    EXPECT_EQ(listed[0].id, 10U);
    EXPECT_EQ(listed[0].parent_id, kNoKeyframe);
    EXPECT_EQ(listed[1].id, 20U);
    EXPECT_EQ(listed[1].parent_id, 10U);
    EXPECT_EQ(listed[1].map_from_camera.translation_m[0], 2);
    EXPECT_EQ(list_keyframes(*map, std::span(listed).first(1)), 1U);

    EngineStatistics statistics;
    fill_map_statistics(*map, statistics);
    EXPECT_EQ(statistics.keyframes.size, 2U);
    EXPECT_EQ(statistics.keyframes.capacity, 4U);
    EXPECT_EQ(statistics.map_points.size, 5U);
    EXPECT_EQ(statistics.points_forgotten, 0U);
    map->release_keyframe(second);
    fill_map_statistics(*map, statistics);
    EXPECT_EQ(statistics.keyframes.size, 1U);
    EXPECT_EQ(statistics.keyframes.high_water, 2U);
    EXPECT_EQ(statistics.map_points.size, 0U);
    EXPECT_EQ(statistics.map_points.high_water, 5U);
    EXPECT_EQ(statistics.points_forgotten, 5U);
    EXPECT_EQ(statistics.points_evicted, 5U);
}

}  // namespace
}  // namespace stillmesh
