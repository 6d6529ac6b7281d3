// Numbers of this room that are no user's concern: one line each, with type, name, default, range, unit and effect.
#pragma once

#include <cstdint>

#include "engine/base/parameter_table.hpp"
#include "engine/configuration.hpp"

namespace stillmesh {

// clang-format off
#define STILLMESH_TUNING_matching(KEY) \
    KEY(matching, std::uint32_t, hamming_max, 64, 1.0, 256.0, "bits", "largest descriptor distance of a match") \
    KEY(matching, std::uint32_t, hamming_wide_max, 48, 1.0, 256.0, "bits", "the same without a prediction") \
    KEY(matching, double, ratio_max, 0.85, 0.1, 1.0, "", "best to second best descriptor distance") \
    KEY(matching, double, radius_px, 12.0, 1.0, 100.0, "px", "search radius around a projection") \
    KEY(matching, double, radius_wide_px, 40.0, 1.0, 400.0, "px", "search radius of the second try") \
    KEY(matching, double, radius_posed_px, 6.0, 1.0, 100.0, "px", "search radius around a projection from a measured pose") \
    KEY(matching, std::uint32_t, matches_min, 60, 3.0, 4000.0, "", "fewer matches start the second try") \
    KEY(matching, std::uint32_t, turn_bins, 3, 1.0, 30.0, "", "turns of the picture (12 degrees) that may agree")
struct MatchingParameters { STILLMESH_TUNING_matching(STILLMESH_FIELD) };

// clang-format on

}  // namespace stillmesh
