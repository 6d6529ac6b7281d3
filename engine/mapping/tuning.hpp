// Numbers of this room that are no user's concern: one line each, with type, name, default, range, unit and effect.
#pragma once

#include <cstdint>

#include "engine/base/parameter_table.hpp"
#include "engine/configuration.hpp"

namespace stillmesh {

// clang-format off
// The map in the shadow of tracking (engine/mapping/mapping.hpp).
#define STILLMESH_TUNING_mapping(KEY) \
    KEY(mapping, bool, is_culling, true, 0.0, 1.0, "", "forget redundant keyframes") \
    KEY(mapping, double, settled_s, 60.0, 0.0, 1e9, "s", "keyframes older than a new one by so much are not moved by its adjustment") \
    KEY(mapping, std::uint32_t, fixed_shared_min, 3, 1.0, 4000.0, "", "points a fixed keyframe shares with the window") \
    KEY(mapping, std::uint32_t, first_iterations_max, 6, 1.0, 100.0, "", "adjustment with outliers") \
    KEY(mapping, std::uint32_t, second_iterations_max, 4, 0.0, 100.0, "", "adjustment without them") \
    KEY(mapping, double, fusion_radius_px, 4.0, 0.1, 100.0, "px", "duplicates are looked for within") \
    KEY(mapping, std::uint32_t, fusion_hamming_max, 50, 0.0, 256.0, "bits", "largest descriptor distance of duplicates") \
    KEY(mapping, double, fusion_scale_factor, 1.6, 1.0, 10.0, "", "off the expected scale") \
    KEY(mapping, double, fusion_depth_chi2_max, 9.0, 0.1, 1000.0, "", "largest squared difference in depth") \
    KEY(mapping, std::uint32_t, roomy_permille, 500, 0.0, 1000.0, "1/1000", "of the keyframes, below which redundant ones stay") \
    KEY(mapping, std::uint32_t, spare_keyframes_permille, 16, 0.0, 500.0, "1/1000", "of the keyframes, kept free ahead of need") \
    KEY(mapping, std::uint32_t, spare_points_permille, 167, 0.0, 500.0, "1/1000", "of the points, kept free ahead of need")
struct MappingTuning { STILLMESH_TUNING_mapping(STILLMESH_FIELD) };
struct MappingParameters : MappingKeys, MappingTuning {};

// clang-format on

}  // namespace stillmesh
