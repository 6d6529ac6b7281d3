// Numbers of this room that are no user's concern: one line each, with type, name, default, range, unit and effect.
#pragma once

#include <cstdint>

#include "engine/base/parameter_table.hpp"
#include "engine/configuration.hpp"

namespace stillmesh {

// clang-format off
#define STILLMESH_TUNING_region(KEY) \
    KEY(region, double, edge_chi2_max, 6.63, 0.1, 1000.0, "", "largest squared Mahalanobis change of an edge") \
    KEY(region, double, edge_sigma_floor_m, 0.005, 0.0, 1.0, "m", "error of an edge that no model has; closer motions (m or rad) are the same") \
    KEY(region, double, score_points, 0.5, 0.0, 100.0, "", "W1 of Eq. 1, where W2 is 1") \
    KEY(region, double, point_chi2_max, 11.34, 0.1, 1000.0, "", "largest squared residual of a static point") \
    KEY(region, std::uint32_t, group_points_min, 6, 3.0, 1000.0, "", "smaller groups get no pose of their own") \
    KEY(region, double, step_m, 0.1, 0.0, 10.0, "m", "a larger step in depth, if steep, parts groups") \
    KEY(region, double, step_slope, 2.0, 0.0, 100.0, "", "steeper than any surface seen for long") \
    KEY(region, double, anchor_chi2_share, 0.5, 0.0, 10.0, "", "of the anchor's squared residual beside that at the map's place") \
    KEY(region, double, agreement_floor, 0.5, 1e-3, 100.0, "", "mean squared residual under which groups are not told apart") \
    KEY(region, double, agreement_base, 10.0, 0.0, 1000.0, "", "points' worth of residuals that a group may have above those of its own motion") \
    KEY(region, double, agreement_share, 0.1, 0.01, 10.0, "", "and as much of each of its points") \
    KEY(region, std::uint32_t, left_over_rounds, 3, 0.0, 14.0, "", "motions sought among them") \
    KEY(region, double, prior_weight, 0.25, 0.0, 100.0, "", "of the expected motion beside Eq. 1") \
    KEY(region, double, prior_sigmas, 5.0, 0.1, 100.0, "", "off the expected motion, where that weight is half, and a score too") \
    KEY(region, double, reach, 0.075, 0.0, 1.0, "", "of the picture's width: so far around it a match stands for its surface before points have a past; 0: for the square of its distance") \
    KEY(region, double, proven_share, 0.5, 0.0, 2.0, "", "of what a pose stands on, that stood still before: the next one does not stand on new points alone; above 1: never asked") \
    KEY(region, double, proven_left, 0.2, 0.0, 2.0, "", "and so much of the next one is enough where it is less than a dozen points, and no frame between was lost") \
    KEY(region, std::uint32_t, elder_points, 12, 0.0, 1000.0, "", "of a rival that were there before all that the best motion explains alone: it is chosen; 0: never") \
    KEY(region, double, rival_area_min, 0.05, 0.0, 1.0, "", "share of the area only a rival explains; less is noise") \
    KEY(region, double, contest_margin, 0.4, -1.0, 1.0, "", "a motion that goes on beside the chosen one and leaves less of a margin makes the last second unsure; -1: none does") \
    KEY(region, std::uint32_t, contest_frames, 2, 1.0, 100.0, "frames", "with this one, that it has gone on for; before, it is none") \
    KEY(region, double, wide_factor, 2.0, 0.1, 100.0, "", "chi2 threshold at a point's anchor, and where the pose is not measured yet, times")
struct RegionTuning { STILLMESH_TUNING_region(STILLMESH_FIELD) };
struct RegionParameters : RegionKeys, RegionTuning {
    // Beyond noise and beyond what threshold and drift leave open: it has moved.
    [[nodiscard]] constexpr double far_chi2() const noexcept { return wide_factor * wide_factor * point_chi2_max; }
    [[nodiscard]] constexpr bool is_paper() const noexcept {
        return is_enabled && method == static_cast<std::uint32_t>(RegionMethod::kPaper);
    }
};

// clang-format on

}  // namespace stillmesh
