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
    KEY(recovery, std::uint32_t, matches_min, 8, 3.0, 4000.0, "", "fewer matches recover nothing") \
    KEY(recovery, double, inlier_share_min, 0.5, 0.0, 1.0, "", "of the matches that must agree") \
    KEY(recovery, double, reach_m, 0.1, 0.0, 1000.0, "m", "how far a camera gets at once") \
    KEY(recovery, double, reach_rad, 0.2, 0.0, 10.0, "rad", "how far a camera turns at once") \
    KEY(recovery, double, sigma_m, 0.02, 1e-4, 10.0, "m", "how far the pose may be from where a place put it") \
    KEY(recovery, double, sigma_rad, 0.02, 1e-4, 3.0, "rad", "how far the pose may be from where a place put it") \
    KEY(recovery, std::uint32_t, there_min, 10, 0.0, 400.0, "", "points of the map whose depth is seen there") \
    KEY(recovery, double, empty_share_max, 0.35, 0.0, 1.0, "", "of those whose place is seen to be empty") \
    KEY(recovery, double, rival_share_max, 0.8, 0.0, 1.0, "", "another place looks at most so much like it as where a lost camera is taken to be")
struct RecoveryTuning { STILLMESH_TUNING_recovery(STILLMESH_FIELD) };
struct RecoveryParameters : RecoveryKeys, RecoveryTuning {};

// clang-format on

}  // namespace stillmesh
