// Numbers of this room that are no user's concern: one line each, with type, name, default, range, unit and effect.
#pragma once

#include <cstdint>

#include "engine/base/parameter_table.hpp"
#include "engine/configuration.hpp"

namespace stillmesh {

// clang-format off
// How a readout is estimated (engine/pose/rolling_shutter.hpp). Residuals of one frame share errors that no model has
// (the map's, the motion's within the frame): a frame counts less than its matches say. Old frames fade within some
// seconds of motion: the map's points say how they would move with the readout, but to first order and with the speeds
// known then.
#define STILLMESH_TUNING_shutter(KEY) \
    KEY(shutter, double, trust, 0.1, 1e-6, 1.0, "", "a frame counts so much less than its matches say") \
    KEY(shutter, double, turn_sigma_rad, 0.01, 0.0, 1.0, "rad", "deviation of the turn within a frame from the expected one, where rows say nothing; 0: they are not asked") \
    KEY(shutter, double, fading, 0.99, 0.0, 1.0, "", "what is left of the frames before from frame to frame") \
    KEY(shutter, std::uint32_t, matches_min, 30, 7.0, 4000.0, "", "fewer matches tell nothing of the readout") \
    KEY(shutter, double, negligible_s, 0.003, 0.0, 0.1, "s", "a shorter readout is none") \
    KEY(shutter, double, step_s, 0.00025, 0.0, 0.1, "s", "smaller changes of what is believed wait") \
    KEY(shutter, double, readout_max_s, 0.04, 0.0, 0.1, "s", "longest readout that is believed") \
    KEY(shutter, double, sigma_s, 0.01, 1e-5, 1.0, "s", "deviation from no rolling shutter, without evidence") \
    KEY(shutter, double, info_share_min, 0.01, 0.0, 1.0, "", "frames that know less, beside that deviation, are passed over")
struct ShutterParameters { STILLMESH_TUNING_shutter(STILLMESH_FIELD) };

#define STILLMESH_TUNING_pose(KEY) \
    KEY(pose, double, confidence, 0.99, 0.5, 0.9999, "", "of RANSAC's iteration rule") \
    KEY(pose, std::uint32_t, coarse_total_max, 1024, 1.0, 20000.0, "", "RANSAC iterations of all groups together") \
    KEY(pose, std::uint32_t, sure_inliers_factor, 2, 1.0, 100.0, "", "times inliers_min inliers make a pose sure") \
    KEY(pose, std::uint32_t, coarse_factor, 3, 1.0, 100.0, "", "RANSAC iterations over the rule's, for a group") \
    KEY(pose, std::uint32_t, final_factor, 10, 1.0, 100.0, "", "RANSAC iterations over the rule's, for the pose") \
    KEY(pose, double, depth_trust, 0.1, 0.0, 1.0, "", "of what matches say of the turn between picture and depth; 0: they are not asked") \
    KEY(pose, double, inlier_ratio_start, 0.5, 0.05, 1.0, "", "share of inliers expected at first") \
    KEY(pose, double, inlier_ratio_min, 0.3, 0.05, 1.0, "", "least share of inliers the rule reckons with") \
    KEY(pose, double, sample_chi2_max, 16.0, 0.1, 1000.0, "", "largest squared change of a length between three points; a residual beyond is just wrong") \
    KEY(pose, std::uint32_t, coarse_passes_max, 4, 1.0, 100.0, "", "adjustment of a motion that is proposed") \
    KEY(pose, std::uint32_t, final_passes_max, 10, 1.0, 100.0, "", "adjustment of the pose")
struct PoseTuning { STILLMESH_TUNING_pose(STILLMESH_FIELD) };
struct PoseParameters : PoseKeys, PoseTuning {
    // Inliers of a sure pose, features that start a map, points that an adjusted keyframe sees.
    [[nodiscard]] constexpr std::uint32_t sure_inliers() const noexcept { return sure_inliers_factor * inliers_min; }
};

// clang-format on

}  // namespace stillmesh
