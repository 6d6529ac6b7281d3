// Numbers of this room that are no user's concern: one line each, with type, name, default, range, unit and effect.
#pragma once

#include <cstdint>

#include "engine/base/parameter_table.hpp"
#include "engine/configuration.hpp"

namespace stillmesh {

// clang-format off
// Coming home (engine/loop_closing/loop_closing.hpp, relocalisation.hpp). Nothing of it without a vocabulary.
#define STILLMESH_TUNING_loop(KEY) \
    KEY(loop, double, score_share, 0.8, 0.0, 1.0, "", "of the least score among neighbours, for those") \
    KEY(loop, double, settle_s, 0.7, 0.0, 100.0, "s", "a keyframe is looked up when what it saw is so old") \
    KEY(loop, std::uint32_t, rest_keyframes, 10, 0.0, 1000.0, "", "after a loop none is sought for so many") \
    KEY(loop, std::uint32_t, candidates_max, 3, 1.0, 8.0, "", "places verified for one keyframe") \
    KEY(loop, std::uint32_t, nodes_level, 1, 1.0, 8.0, "", "features under one node of this level of the vocabulary are compared") \
    KEY(loop, double, radius_px, 8.0, 1.0, 100.0, "px", "search radius around a projection") \
    KEY(loop, std::uint32_t, first_inliers_min, 12, 3.0, 4000.0, "", "fewer that agree are not looked at further") \
    KEY(loop, double, spread_min, 0.25, 0.0, 1.0, "", "share of width and of height that they span at least") \
    KEY(loop, double, drift_m, 0.3, 0.0, 1000.0, "m", "odometry can have drifted by so much") \
    KEY(loop, double, correction_min_m, 0.01, 0.0, 10.0, "m", "a smaller correction is none") \
    KEY(loop, double, correction_min_rad, 0.01, 0.0, 3.0, "rad", "a smaller correction is none") \
    KEY(loop, double, correction_chi2_min, 12.59, 0.0, 1e6, "", "one of fewer squared deviations of what verification measured is none either")
struct LoopTuning { STILLMESH_TUNING_loop(STILLMESH_FIELD) };
struct LoopParameters : LoopKeys, LoopTuning {};

// clang-format on

}  // namespace stillmesh
