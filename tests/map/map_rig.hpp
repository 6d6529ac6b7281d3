// A map in memory of its own, and what tests put into it.
#pragma once

#include <gtest/gtest.h>

#include <cstdint>

#include "engine/map/map.hpp"
#include "tests/support/memory.hpp"

namespace stillmesh::test {

using MapInMemory = InMemory<Map>;

inline Limits small(std::uint32_t keyframes, std::uint32_t points, std::uint32_t features) {
    Limits limits = Limits::tiny();
    limits.keyframes_max = keyframes;
    limits.map_points_max = points;
    limits.features_max = features;
    return limits;
}

inline Observation observation_of(Handle<MapPoint> point, float x = 0) {
    Observation out;
    out.point = point;
    out.x = x;
    return out;
}

inline Handle<MapPoint> add_point(Map& map, std::uint64_t seen_in = 0) {
    const auto taken = map.add_point();
    EXPECT_TRUE(taken.is_ok());
    map.points().find(taken.value())->last_seen_frame = seen_in;
    return taken.value();
}

inline Handle<Keyframe> add_keyframe(Map& map, std::uint64_t frame) {
    const Handle<Keyframe> handle = map.add_keyframe();
    EXPECT_FALSE(handle.is_null());
    map.keyframes().find(handle)->frame = frame;
    map.keyframes().find(handle)->last_useful_frame = frame;
    return handle;
}

}  // namespace stillmesh::test
