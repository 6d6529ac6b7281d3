// Numbers of this room that are no user's concern: one line each, with type, name, default, range, unit and effect.
#pragma once

#include <cstdint>

#include "engine/base/parameter_table.hpp"
#include "engine/configuration.hpp"

namespace stillmesh {

// clang-format off
#define STILLMESH_TUNING_features(KEY) \
    KEY(features, std::uint32_t, even_permille, 1000, 0.0, 1000.0, "1/1000", "features given out by place alone")
struct FeatureTuning { STILLMESH_TUNING_features(STILLMESH_FIELD) };
struct FeatureParameters : FeatureKeys, FeatureTuning {};

// clang-format on

}  // namespace stillmesh
