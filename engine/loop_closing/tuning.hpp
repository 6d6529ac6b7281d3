// Numbers of this room that are no user's concern: one line each, with type, name, default, range, unit and effect.
#pragma once

#include "engine/base/parameter_table.hpp"
#include "engine/configuration.hpp"

namespace stillmesh {

// clang-format off
// Coming home (engine/loop_closing/loop_closing.hpp, relocalisation.hpp). Nothing of it without a vocabulary.
#define STILLMESH_TUNING_loop(KEY) \
    KEY(loop, double, score_share, 0.8, 0.0, 1.0, "", "of the least score among neighbours, for a candidate; a place as much alike as that is a rival") \
    KEY(loop, double, spread_min, 0.25, 0.0, 1.0, "", "share of width and of height that they span at least") \
    KEY(loop, double, drift_m, 0.3, 0.0, 1000.0, "m", "odometry can have drifted by so much") \
    KEY(loop, double, correction_min_m, 0.01, 0.0, 10.0, "m or rad", "a smaller correction is none") \
    KEY(loop, double, correction_chi2_min, 12.59, 0.0, 1e6, "", "one of fewer squared deviations of what verification measured is none either")
struct LoopTuning { STILLMESH_TUNING_loop(STILLMESH_FIELD) };
struct LoopParameters : LoopKeys, LoopTuning {};

// clang-format on

}  // namespace stillmesh
