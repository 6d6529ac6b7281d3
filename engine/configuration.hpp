// Every number the method depends on, with its default (method.md), range and unit. Plain data; visit_parameters names
// each key once, for configuration files, help texts and recordings.
#pragma once

#include <cstdint>

namespace stillmesh {

struct FeatureParameters {
    std::uint32_t count = 1000;
    std::uint32_t levels = 8;
    double scale_factor = 1.2;
    std::uint32_t fast_threshold = 20;
    std::uint32_t fast_threshold_low = 7;
    std::uint32_t even_permille = 1000;  // the room is where features are few, a patterned shirt where they are many
};

struct DepthParameters {
    double sigma_z_per_m2 = 1.425e-3;  // method.md 1
    double sigma_pixel = 1.0;
    double z_min_m = 0.3;
    double z_max_m = 6.0;
    double sigma_max_m = 0.15;
};

struct MatchingParameters {
    std::uint32_t hamming_max = 64;
    std::uint32_t hamming_wide_max = 48;  // without a prediction to narrow the search
    double ratio_max = 0.85;
    double radius_px = 12.0;         // around the projection, at level 0, times the level's scale
    double radius_wide_px = 40.0;    // second try, when the prediction was poor
    std::uint32_t matches_min = 60;  // fewer: the second try
};

struct RegionParameters {
    bool is_enabled = true;              // off: every match votes alike (for measuring what the extraction earns)
    double edge_change_max_m = 0.1;      // tau; 0.5 outdoors
    double edge_chi2_max = 6.63;         // 1 degree of freedom, 99 %
    double edge_sigma_floor_m = 0.005;   // method.md 4
    double colour_depth_lag_s = 0.010;   // between colour and depth, unless the frame tells
    double score_points = 0.5;           // W1, Eq. 1
    double score_area = 1.0;             // W2
    double point_chi2_max = 11.34;       // 3 degrees of freedom, 99 %
    std::uint32_t group_points_min = 6;  // smaller groups get no pose of their own
    double margin_min = 0.0;             // of the choice, below: unsure
    double score_min = 0.2;              // of the choice, below: unsure
};

struct PoseParameters {
    double confidence = 0.99;  // p of the iteration rule
    std::uint32_t coarse_iterations_max = 507;
    std::uint32_t final_iterations_max = 1690;
    std::uint32_t coarse_total_max = 1024;  // hypotheses of all groups of a frame together
    std::uint32_t inliers_min = 8;          // fewer: no pose from this frame; fewer than twice that: unsure
    std::uint32_t lost_frames_max = 30;     // predicted for at most so many frames
    double sure_sigma_m = 0.025;            // of the motion over the last second, all axes together; above: unsure
    double sure_sigma_rad = 0.025;
};

struct WeightParameters {
    std::uint32_t start = 10;      // tenths; w = 1
    std::uint32_t suspicious = 9;  // of a new feature inside a rejected group
    std::uint32_t step = 1;        // theta = 0.1
    std::uint32_t max = 20;        // w = 2
    std::uint32_t eligible = 10;   // static threshold
};

struct KeyframeParameters {
    double tracked_share_max = 0.8;
    std::uint32_t new_points_min = 40;
    std::uint32_t gap_min = 8;           // frames
    double tracked_share_urgent = 0.4;   // below: the gap does not count
    std::uint32_t tracked_urgent = 120;  // static points, below: the gap does not count
};

// Background work in work units (engine/schedule/task.hpp).
struct ScheduleParameters {
    std::uint32_t units_per_frame = 20000;  // granted after each frame by replay and simulation
    std::uint32_t slice_units = 2000;       // the most one task gets before the one above it is asked again
};

// The map in the shadow of tracking (engine/tasks/mapping.hpp).
struct MappingParameters {
    bool is_enabled = true;    // off: tracking alone, over a sliding set of keyframes (to measure what mapping earns)
    bool is_adjusting = true;  // local bundle adjustment
    bool is_filtered = true;   // its observation from a point's reference keyframe: what tracking filtered since
    bool is_fusing = true;
    bool is_triangulating = true;
    bool is_culling = true;               // redundant keyframes
    std::uint32_t window_keyframes = 10;  // free ones of an adjustment, the new one included
};

struct Configuration {
    FeatureParameters features;
    DepthParameters depth;
    MatchingParameters matching;
    RegionParameters region;
    PoseParameters pose;
    WeightParameters weights;
    KeyframeParameters keyframes;
    ScheduleParameters schedule;
    MappingParameters mapping;
    std::uint64_t seed = 1;  // of RANSAC

    [[nodiscard]] static constexpr Configuration indoor() noexcept { return {}; }
    [[nodiscard]] static constexpr Configuration outdoor() noexcept {
        Configuration out;
        out.region.edge_change_max_m = 0.5;
        return out;
    }
};

// Calls visitor(name, value, min, max, unit, sentence) for every parameter; value is a reference to bool,
// std::uint32_t, std::uint64_t or double, min and max are doubles.
template <typename Visitor>
constexpr void visit_parameters(Configuration& c, Visitor&& v) {
    v("features.count", c.features.count, 50.0, 4000.0, "", "features per frame, at most the limit of the preset");
    v("features.levels", c.features.levels, 1.0, 12.0, "", "levels of the image pyramid");
    v("features.scale_factor", c.features.scale_factor, 1.2, 1.9, "", "from one pyramid level to the next");
    v("features.fast_threshold", c.features.fast_threshold, 2.0, 120.0, "grey levels", "corner threshold");
    v("features.fast_threshold_low", c.features.fast_threshold_low, 1.0, 120.0, "grey levels",
      "corner threshold where a cell has no corner otherwise");
    v("features.even_permille", c.features.even_permille, 0.0, 1000.0, "1/1000", "features given out by place alone");
    v("depth.sigma_z_per_m2", c.depth.sigma_z_per_m2, 1e-5, 0.1, "1/m", "depth noise: sigma = this * z^2");
    v("depth.sigma_pixel", c.depth.sigma_pixel, 0.05, 10.0, "px", "noise of a feature's position at level 0");
    v("depth.z_min_m", c.depth.z_min_m, 0.05, 5.0, "m", "nearest depth that is used");
    v("depth.z_max_m", c.depth.z_max_m, 0.5, 50.0, "m", "farthest depth that is used");
    v("depth.sigma_max_m", c.depth.sigma_max_m, 0.001, 5.0, "m", "features with a larger depth deviation are isolated");
    v("matching.hamming_max", c.matching.hamming_max, 1.0, 256.0, "bits", "largest descriptor distance of a match");
    v("matching.hamming_wide_max", c.matching.hamming_wide_max, 1.0, 256.0, "bits", "the same without a prediction");
    v("matching.ratio_max", c.matching.ratio_max, 0.1, 1.0, "", "best to second best descriptor distance");
    v("matching.radius_px", c.matching.radius_px, 1.0, 100.0, "px", "search radius around a projection");
    v("matching.radius_wide_px", c.matching.radius_wide_px, 1.0, 400.0, "px", "search radius of the second try");
    v("matching.matches_min", c.matching.matches_min, 3.0, 4000.0, "", "fewer matches start the second try");
    v("region.is_enabled", c.region.is_enabled, 0.0, 1.0, "", "extract the static region; off: all matches vote");
    v("region.edge_change_max_m", c.region.edge_change_max_m, 0.001, 5.0, "m", "largest change of a kept edge (tau)");
    v("region.edge_chi2_max", c.region.edge_chi2_max, 0.1, 1000.0, "", "largest squared Mahalanobis change of an edge");
    v("region.edge_sigma_floor_m", c.region.edge_sigma_floor_m, 0.0, 1.0, "m", "error of an edge nobody models");
    v("region.colour_depth_lag_s", c.region.colour_depth_lag_s, 0.0, 0.1, "s", "between colour and depth images");
    v("region.score_points", c.region.score_points, 0.0, 100.0, "", "W1 of Eq. 1");
    v("region.score_area", c.region.score_area, 0.0, 100.0, "", "W2 of Eq. 1");
    v("region.point_chi2_max", c.region.point_chi2_max, 0.1, 1000.0, "", "largest squared residual of a static point");
    v("region.group_points_min", c.region.group_points_min, 3.0, 1000.0, "", "smaller groups get no pose of their own");
    v("region.margin_min", c.region.margin_min, -1.0, 1.0, "", "smaller margin of the choice makes a pose unsure");
    v("region.score_min", c.region.score_min, 0.0, 1.0, "", "smaller score of the choice makes a pose unsure");
    v("pose.confidence", c.pose.confidence, 0.5, 0.9999, "", "of RANSAC's iteration rule");
    v("pose.coarse_iterations_max", c.pose.coarse_iterations_max, 1.0, 5000.0, "", "RANSAC iterations for one group");
    v("pose.final_iterations_max", c.pose.final_iterations_max, 1.0, 5000.0, "", "RANSAC iterations for the pose");
    v("pose.coarse_total_max", c.pose.coarse_total_max, 1.0, 20000.0, "", "RANSAC iterations of all groups together");
    v("pose.inliers_min", c.pose.inliers_min, 4.0, 1000.0, "", "fewer static inliers give no pose");
    v("pose.lost_frames_max", c.pose.lost_frames_max, 0.0, 1000.0, "frames", "how long a lost pose is predicted");
    v("pose.sure_sigma_m", c.pose.sure_sigma_m, 1e-4, 10.0, "m", "less certain motion over a second is unsure");
    v("pose.sure_sigma_rad", c.pose.sure_sigma_rad, 1e-4, 3.0, "rad", "less certain motion over a second is unsure");
    v("weights.start", c.weights.start, 0.0, 200.0, "1/10", "static weight of a new point");
    v("weights.suspicious", c.weights.suspicious, 0.0, 200.0, "1/10", "the same inside a rejected group");
    v("weights.step", c.weights.step, 1.0, 100.0, "1/10", "theta, added or taken per frame");
    v("weights.max", c.weights.max, 1.0, 200.0, "1/10", "largest static weight");
    v("weights.eligible", c.weights.eligible, 0.0, 200.0, "1/10", "static threshold");
    v("keyframes.tracked_share_max", c.keyframes.tracked_share_max, 0.05, 1.0, "", "track more: no new keyframe");
    v("keyframes.new_points_min", c.keyframes.new_points_min, 1.0, 4000.0, "", "a new keyframe adds at least so many");
    v("keyframes.gap_min", c.keyframes.gap_min, 1.0, 300.0, "frames", "from one keyframe to the next");
    v("keyframes.tracked_share_urgent", c.keyframes.tracked_share_urgent, 0.0, 1.0, "", "below: the gap is ignored");
    v("keyframes.tracked_urgent", c.keyframes.tracked_urgent, 0.0, 4000.0, "", "below: the gap is ignored");
    v("schedule.units_per_frame", c.schedule.units_per_frame, 1.0, 1e9, "units", "background work after each frame");
    v("schedule.slice_units", c.schedule.slice_units, 1.0, 1e9, "units", "background work in one piece");
    v("mapping.is_enabled", c.mapping.is_enabled, 0.0, 1.0, "", "a map that is refined; off: tracking alone");
    v("mapping.is_adjusting", c.mapping.is_adjusting, 0.0, 1.0, "", "local bundle adjustment");
    v("mapping.is_filtered", c.mapping.is_filtered, 0.0, 1.0, "", "adjust with what tracking filtered");
    v("mapping.is_fusing", c.mapping.is_fusing, 0.0, 1.0, "", "fuse duplicates with neighbours");
    v("mapping.is_triangulating", c.mapping.is_triangulating, 0.0, 1.0, "", "points for features without depth");
    v("mapping.is_culling", c.mapping.is_culling, 0.0, 1.0, "", "forget redundant keyframes");
    v("mapping.window_keyframes", c.mapping.window_keyframes, 2.0, 12.0, "", "free keyframes of an adjustment");
    v("seed", c.seed, 0.0, 9007199254740992.0, "", "of the random numbers");
}

}  // namespace stillmesh
