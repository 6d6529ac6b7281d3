// Numbers of this room that are no user's concern: one line each, with type, name, default, range, unit and effect.
#pragma once

#include <cstdint>

#include "engine/base/parameter_table.hpp"
#include "engine/configuration.hpp"

namespace stillmesh {

// clang-format off
// The map in the shadow of tracking (engine/mapping/mapping.hpp).
#define STILLMESH_TUNING_mapping(KEY) \
    KEY(mapping, double, settled_s, 60.0, 0.0, 1e9, "s", "keyframes older than a new one by so much are not moved by its adjustment") \
    KEY(mapping, std::uint32_t, first_iterations_max, 6, 1.0, 100.0, "", "adjustment with outliers") \
    KEY(mapping, std::uint32_t, second_iterations_max, 4, 0.0, 100.0, "", "adjustment without them")
struct MappingTuning { STILLMESH_TUNING_mapping(STILLMESH_FIELD) };
struct MappingParameters : MappingKeys, MappingTuning {};

// clang-format on

}  // namespace stillmesh
