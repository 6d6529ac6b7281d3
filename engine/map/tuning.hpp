// Numbers of this room that are no user's concern: one line each, with type, name, default, range, unit and effect.
#pragma once

#include <cstdint>

#include "engine/base/parameter_table.hpp"
#include "engine/configuration.hpp"

namespace stillmesh {

// clang-format off
// What the map keeps (engine/map/map.hpp).
#define STILLMESH_TUNING_map(KEY) \
    KEY(map, std::uint32_t, cull_after_frames, 30, 1.0, 1e6, "frames", "weak points unseen for so long go") \
    KEY(map, std::uint32_t, shared_min, 15, 1.0, 4000.0, "", "points that two keyframes share to be neighbours") \
    KEY(map, std::uint32_t, seen_min, 3, 1.0, 65535.0, "frames", "points seen in fewer are weak; others that see a point well enough") \
    KEY(map, double, near_m, 2.0, 0.0, 100.0, "m", "a near view; of keyframes with one as near the newer goes first") \
    KEY(map, std::uint32_t, redundant_permille, 900, 1.0, 1000.0, "1/1000", "such points make a keyframe redundant") \
    KEY(map, std::uint32_t, averaged_max, 10, 1.0, 255.0, "frames", "a keyframe's measurement is the mean of at most so many") \
    KEY(map, double, averaged_reach, 0.05, 0.0, 1.0, "", "looked from so near, over the depth, for that mean")
struct MapParameters { STILLMESH_TUNING_map(STILLMESH_FIELD) };

// The part of the map that a frame is matched against (engine/map/local_map.hpp).
#define STILLMESH_TUNING_local_map(KEY) \
    KEY(local_map, double, moved_m, 0.15, 0.0, 1.0, "m", "a view farther off, and other points come into view") \
    KEY(local_map, std::uint32_t, sharing_keyframes, 12, 1.0, 24.0, "", "that share most with the frame") \
    KEY(local_map, std::uint32_t, near_keyframes, 8, 0.0, 24.0, "", "with near viewpoints") \
    KEY(local_map, std::uint32_t, neighbours, 6, 0.0, 24.0, "", "of each keyframe taken in") \
    KEY(local_map, double, farther_max, 3.0, 1.0, 100.0, "", "multiple of it, seen from farther")
struct LocalMapParameters { STILLMESH_TUNING_local_map(STILLMESH_FIELD) };

// clang-format on

}  // namespace stillmesh
