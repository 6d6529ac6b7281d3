// Numbers of this room that are no user's concern: one line each, with type, name, default, range, unit and effect.
#pragma once

#include <cstdint>

#include "engine/base/parameter_table.hpp"
#include "engine/configuration.hpp"

namespace stillmesh {

// clang-format off
// Look-alikes are everywhere: nobody gets farther in the time than a camera on a robot or in a hand can.
#define STILLMESH_TUNING_recovery(KEY) \
    KEY(recovery, std::uint32_t, keyframes_max, 16, 1.0, 1000.0, "", "recent ones tried in turn") \
    KEY(recovery, double, inlier_share_min, 0.5, 0.0, 2.0, "", "of the matches that must agree; above 1 nothing is recovered") \
    KEY(recovery, double, reach_m, 0.1, 0.0, 1000.0, "m", "how far a camera gets at once") \
    KEY(recovery, double, reach_rad, 0.2, 0.0, 10.0, "rad", "how far a camera turns at once") \
    KEY(recovery, double, empty_share_max, 0.5, 0.0, 1.0, "", "of the cells of the picture in which the map is seen to be empty")
struct RecoveryTuning { STILLMESH_TUNING_recovery(STILLMESH_FIELD) };
struct RecoveryParameters : RecoveryKeys, RecoveryTuning {};

// clang-format on

}  // namespace stillmesh
