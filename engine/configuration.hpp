// Every number the method depends on, with its default (method.md), range and unit. Plain data; visit_parameters names
// each key once, for configuration files, help texts and recordings.
#pragma once

#include <cstdint>

namespace stillmesh {

struct CameraParameters {
    double readout_s = -1;  // of a rolling shutter, from the first row to the last; negative: estimated
};

// How a readout is estimated (engine/pose/rolling_shutter.hpp). Residuals of one frame share errors that no model has
// (the map's, the motion's within the frame): a frame counts less than its matches say. Old frames fade within some
// seconds of motion: the map's points say how they would move with the readout, but to first order and with the speeds
// known then.
struct ShutterParameters {
    double trust = 0.1;
    double fading = 0.99;
    std::uint32_t matches_min = 30;
    double negligible_s = 0.003;  // a tenth of what such cameras take, and within what a global shutter is estimated at
    double readout_max_s = 0.04;  // a sensor may be read upwards, too
    double step_s = 0.00025;      // all of the map moves with what is believed
    double sigma_s = 0.01;        // without evidence there is no rolling shutter, with this deviation
    double info_share_min = 0.01;  // a camera that stands still does not make what is known fade
};

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
    double level_factor = 1.095;     // the middle between two levels
    std::uint32_t levels_off = 1;
    std::uint32_t turn_bins = 3;
    std::uint32_t turn_factor = 10;
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
    // docs/tracking.md says why; each sentence is in visit_parameters.
    double step_m = 0.1;
    double step_slope = 2.0;
    double anchor_chi2_share = 0.5;
    double badness_max = 16.0;
    double agreement_floor = 0.5;
    double agreement_base = 10.0;
    double agreement_share = 0.1;
    double reach_factor = 4.0;
    double group_inliers_start = 0.7;
    std::uint32_t left_over_min = 12;
    double left_over_inliers_start = 0.4;
    std::uint32_t left_over_rounds = 3;
    double prior_weight = 0.25;
    double prior_sigmas = 3.0;
    double plausible_sigmas = 5.0;
    double same_motion_m = 0.005;
    double same_motion_rad = 0.005;
    double rival_area_min = 0.05;
    double anchor_inlier_factor = 2.0;
    double more_factor = 2.0;
    double more_anchor_factor = 3.0;
    double more_radius_share = 0.5;
};

struct PoseParameters {
    double confidence = 0.99;  // p of the iteration rule
    std::uint32_t coarse_iterations_max = 507;
    std::uint32_t final_iterations_max = 1690;
    std::uint32_t coarse_total_max = 1024;  // hypotheses of all groups of a frame together
    std::uint32_t inliers_min = 8;          // fewer: no pose from this frame; fewer than twice that: unsure
    std::uint32_t lost_frames_max = 30;     // predicted for at most so many frames
    double sure_sigma_m = 0.03;             // of the motion over the last second, all axes together; above: unsure
    double sure_sigma_rad = 0.03;
    std::uint32_t sure_inliers_factor = 2;
    std::uint32_t start_inliers_factor = 2;
    // RANSAC and the passes of the motion-only adjustment (paper 3.1: 3k and 10k).
    std::uint32_t coarse_factor = 3;
    std::uint32_t final_factor = 10;
    double inlier_ratio_start = 0.5;
    double inlier_ratio_min = 0.3;
    double sample_chi2_max = 16.0;
    std::uint32_t coarse_passes_max = 4;
    std::uint32_t expected_passes_max = 6;
    std::uint32_t final_passes_max = 10;
};

struct WeightParameters {
    std::uint32_t start = 10;      // tenths; w = 1
    std::uint32_t suspicious = 9;  // of a new feature inside a rejected group
    std::uint32_t step = 1;        // theta = 0.1
    std::uint32_t max = 20;        // w = 2
    std::uint32_t eligible = 10;   // static threshold
    // What a point's past is worth (method.md 7 and 11).
    double proven_s = 0.7;
    double unproven = 0.03;
    std::uint32_t suspect_steps = 3;
    double anchor_age_s = 1.0;
    double anchor_proven_share = 0.5;
    double drift_m = 0.003;
    double drift_m_s = 0.002;
    double drift_max_m = 0.02;
    double drift_share = 0.001;
    double gain_min = 0.03;
    double variance_min = 0.1;
    double near_px = 40.0;
    double near_m = 0.2;
    double near_sigmas = 3.0;
};

// How far real noise leaves the model's, followed from frame to frame.
struct NoiseParameters {
    double pixel_start = 0.1;
    double depth_start = 0.3;
    double pixel_min = 0.06;
    double depth_min = 0.25;
    double max = 20.0;
    std::uint32_t young_frames = 6;
    double explained_min = 0.6;
    std::uint32_t first_tries = 4;
    std::uint32_t tries = 2;
    double pixel_try_factor = 2.5;
    double depth_try_factor = 2.0;
    double fall_young = 0.1;
    double rise_young = 2.0;
    double fall = 0.9;
    double rise = 1.25;
    std::uint32_t residuals_min = 30;
};

// Constant velocity. Hands and wheels accelerate by some m/s^2 and some tens of rad/s^2, and the last velocity is
// itself measured. Without one (still_), the camera may have been moving already when it was switched on.
struct PredictionParameters {
    double sigma_m = 0.004;
    double sigma_m_s = 0.06;
    double sigma_rad = 0.01;
    double sigma_rad_s = 0.5;
    double still_sigma_m = 0.01;
    double still_sigma_m_s = 0.8;
    double still_sigma_rad = 0.01;
    double still_sigma_rad_s = 1.2;
    double retry_sigma_factor = 3.0;
    double turn_max_rad_s = 4.0;
    double slip_share = 0.2;
    double gap_max = 3.0;
    double fading_lost = 0.8;
    std::uint32_t fading_frames_max = 20;
    double fading_unsure = 0.7;
    double jump_sigmas = 2.0;
    double goes_on_s = 0.3;
    double acceleration_m_s2 = 10.0;
    double acceleration_rad_s2 = 60.0;
};

// Look-alikes are everywhere: nobody gets farther in the time than a camera on a robot or in a hand can.
struct RecoveryParameters {
    std::uint32_t keyframes_max = 16;
    std::uint32_t matches_min = 8;
    double inliers_start = 0.3;
    double inlier_share_min = 0.5;
    double reach_m = 0.1;
    double reach_m_s = 1.5;
    double reach_rad = 0.2;
    double reach_rad_s = 2.0;
    double sigma_m = 0.02;  // of a place that was proposed
    double sigma_rad = 0.02;
    std::uint32_t probation_frames = 8;
    std::uint32_t there_min = 10;  // points of the map that the depth image confirms
    double empty_share_max = 0.35;
    double rival_share_max = 0.8;
};

// Points whose place is seen to be empty.
struct EmptinessParameters {
    std::uint32_t places_per_frame = 400;
    std::uint32_t reach_px = 3;
    double sigmas = 5.0;
    double margin_m = 0.06;
    std::uint32_t views = 5;
};

struct KeyframeParameters {
    double tracked_share_max = 0.8;
    std::uint32_t new_points_min = 40;
    std::uint32_t gap_min = 8;                    // frames
    double tracked_share_urgent = 0.4;            // below: the gap does not count
    std::uint32_t tracked_urgent_permille = 120;  // static points, of the features; below: the gap does not count
    std::uint32_t gap_urgent = 2;                 // frames, even so
    std::uint32_t new_per_tracked = 2;            // new points that count as one tracked
};

// Background work in work units (engine/schedule/task.hpp).
struct ScheduleParameters {
    std::uint32_t units_per_frame = 20000;  // granted after each frame by replay and simulation
    std::uint32_t slice_units = 2000;       // the most one task gets before the one above it is asked again
};

// The map in the shadow of tracking (engine/mapping/mapping.hpp).
struct MappingParameters {
    bool is_enabled = true;    // off: tracking alone, over a sliding set of keyframes (to measure what mapping earns)
    bool is_adjusting = true;  // local bundle adjustment
    bool is_fusing = false;
    bool is_triangulating = false;
    bool is_culling = true;  // redundant keyframes
    double settled_s = 60.0;
    std::uint32_t window_keyframes = 10;  // free ones of an adjustment, the new one included
    std::uint32_t shared_min = 15;
    std::uint32_t fixed_shared_min = 3;
    std::uint32_t adjusted_points_min = 16;
    double chi2_max_pixel = 5.991;  // 2 degrees of freedom, 95 %
    double chi2_max_depth = 7.815;  // 3 degrees of freedom, 95 %
    std::uint32_t first_iterations_max = 6;
    std::uint32_t second_iterations_max = 4;
    double triangulation_chi2_max = 3.84;  // 1 degree of freedom, 95 %
    double parallax_cosine_max = 0.9998;   // 1.15 degrees
    double triangulation_sigma_factor = 2.0;
    std::uint32_t triangulation_keyframes = 2;
    std::uint32_t fusion_keyframes = 5;
    double fusion_radius_px = 4.0;
    std::uint32_t fusion_hamming_max = 50;
    double fusion_scale_factor = 1.6;
    double fusion_depth_chi2_max = 9.0;
    std::uint32_t roomy_permille = 500;  // of the pool
    std::uint32_t spare_keyframes_permille = 16;
    std::uint32_t spare_points_permille = 167;
};

// What the map keeps (engine/map/map.hpp).
struct MapParameters {
    std::uint32_t cull_after_frames = 30;
    std::uint32_t seen_min = 3;
    double crowded_m = 2.0;  // viewpoints farther from all others go by age alone
    double turn_m2 = 4.0;
    std::uint32_t redundant_observers = 3;
    std::uint32_t redundant_permille = 900;
    double redundant_scale_factor = 1.1;
    std::uint32_t looks_max = 10;
    double looks_reach = 0.05;
};

// The part of the map that a frame is matched against (engine/map/local_map.hpp).
struct LocalMapParameters {
    double moved_m = 0.15;
    double moved_cosine_min = 0.995;  // 5.7 degrees
    double near_m = 1.5;              // a near viewpoint: half a picture and a metre and a half away at most
    double near_cosine_min = 0.8;
    double turn_m2 = 4.0;
    std::uint32_t sharing_keyframes = 12;
    std::uint32_t near_keyframes = 8;
    std::uint32_t neighbours = 6;
    std::uint32_t shared_min = 15;
    std::uint32_t useful_factor = 10;
    double nearer_min = 0.3;  // than where a point was made from; eight levels of 1.2 span 3.6
    double farther_max = 3.0;
};

// Coming home (engine/loop_closing/loop_closing.hpp, relocalisation.hpp). Nothing of it without a vocabulary.
struct LoopParameters {
    bool is_enabled = true;
    bool is_relocalising = true;
    bool is_adjusting = true;        // global bundle adjustment after a loop
    std::uint32_t consistency = 5;   // k: queries before that must agree
    double score_share = 0.8;        // of s_min, for those
    double distance_max_m = 1.5;     // geometric consistency; 3 outdoors
    std::uint32_t gap_frames = 150;  // nearer in time is no loop
    double settle_s = 0.7;
    std::uint32_t rest_keyframes = 10;
    std::uint32_t candidates_max = 3;
    // Verification.
    std::uint32_t nodes_level = 1;  // of the vocabulary's tree; at most its levels
    std::uint32_t hamming_max = 64;
    std::uint32_t hamming_guided_max = 64;
    double ratio_max = 0.85;
    double radius_px = 8.0;
    std::uint32_t iterations_max = 500;
    double chi2_max = 11.34;
    std::uint32_t matches_min = 20;
    std::uint32_t first_inliers_min = 12;
    std::uint32_t inliers_min = 40;
    double spread_min = 0.25;
    // How far odometry can have drifted.
    double drift_m = 0.3;
    double drift_share = 0.05;
    double drift_lost_m_s = 1.5;
    double correction_min_m = 0.01;
    double correction_min_rad = 0.01;
    double correction_chi2_min = 12.59;  // 95 % of six unknowns
};

// Places beyond memory (engine/paging/map_pager.hpp). Nothing of it without a store.
struct StoreParameters {
    std::uint32_t regions_max = 20000;   // full: the ones longest without use go
    std::uint32_t points_min = 20;       // static ones; a region with fewer is not kept
    std::uint32_t gap_frames = 150;      // nearer in time is no place that is seen again
    std::uint32_t pause_frames = 3;      // between two regions that come back
    std::uint32_t rest_frames = 150;     // a region that came back does not come again sooner
    std::uint32_t patience_frames = 90;  // then an answer is given up
    double score_share = 0.5;            // of the least score among neighbours
    double lost_score_min = 0.01;        // of a lost camera's picture, of 1
    double twin_m = 0.3;                 // a place that is kept from so near is not kept again
    double twin_cosine_min = 0.95;       // if it was looked at the same way
    double moved_m = 0.02;               // a region that moved by so much is kept anew
    double moved_rad = 0.01;
};

struct Configuration {
    CameraParameters camera;
    ShutterParameters shutter;
    FeatureParameters features;
    DepthParameters depth;
    MatchingParameters matching;
    RegionParameters region;
    PoseParameters pose;
    WeightParameters weights;
    NoiseParameters noise;
    PredictionParameters prediction;
    RecoveryParameters recovery;
    EmptinessParameters emptiness;
    KeyframeParameters keyframes;
    ScheduleParameters schedule;
    MappingParameters mapping;
    MapParameters map;
    LocalMapParameters local_map;
    LoopParameters loop;
    StoreParameters store;
    std::uint64_t seed = 1;  // of RANSAC

    [[nodiscard]] static constexpr Configuration indoor() noexcept { return {}; }
    [[nodiscard]] static constexpr Configuration outdoor() noexcept {
        Configuration out;
        out.region.edge_change_max_m = 0.5;
        out.loop.distance_max_m = 3.0;
        return out;
    }
};

// Calls visitor(name, value, min, max, unit, sentence) for every parameter; value is a reference to bool,
// std::uint32_t, std::uint64_t or double, min and max are doubles.
template <typename Visitor>
constexpr void visit_parameters(Configuration& c, Visitor&& v) {
    v("camera.readout_s", c.camera.readout_s, -1.0, 0.1, "s", "of a rolling shutter; 0: none; negative: estimated");
    v("shutter.trust", c.shutter.trust, 1e-6, 1.0, "", "a frame counts so much less than its matches say");
    v("shutter.fading", c.shutter.fading, 0.0, 1.0, "", "what is left of the frames before from frame to frame");
    v("shutter.matches_min", c.shutter.matches_min, 7.0, 4000.0, "", "fewer matches tell nothing of the readout");
    v("shutter.negligible_s", c.shutter.negligible_s, 0.0, 0.1, "s", "a shorter readout is none");
    v("shutter.step_s", c.shutter.step_s, 0.0, 0.1, "s", "smaller changes of what is believed wait");
    v("shutter.readout_max_s", c.shutter.readout_max_s, 0.0, 0.1, "s", "longest readout that is believed");
    v("shutter.sigma_s", c.shutter.sigma_s, 1e-5, 1.0, "s", "deviation from no rolling shutter, without evidence");
    v("shutter.info_share_min", c.shutter.info_share_min, 0.0, 1.0, "",
      "frames that know less, beside that deviation, are passed over");
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
    v("matching.level_factor", c.matching.level_factor, 1.0, 2.0, "", "scale from which the next level is expected");
    v("matching.levels_off", c.matching.levels_off, 0.0, 12.0, "", "levels off the expected one that may match");
    v("matching.turn_bins", c.matching.turn_bins, 1.0, 30.0, "", "turns of the picture (12 degrees) that may agree");
    v("matching.turn_factor", c.matching.turn_factor, 1.0, 1000.0, "",
      "a turn with so many times fewer matches than the first is an accident");
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
    v("region.step_m", c.region.step_m, 0.0, 10.0, "m", "a larger step in depth, if steep, parts groups");
    v("region.step_slope", c.region.step_slope, 0.0, 100.0, "", "steeper than any surface seen for long");
    v("region.anchor_chi2_share", c.region.anchor_chi2_share, 0.0, 10.0, "",
      "of the anchor's squared residual in a point's badness");
    v("region.badness_max", c.region.badness_max, 0.1, 1000.0, "", "a point's squared residual beyond is just wrong");
    v("region.agreement_floor", c.region.agreement_floor, 1e-3, 100.0, "",
      "badness under which groups are not told apart");
    v("region.agreement_base", c.region.agreement_base, 0.0, 1000.0, "",
      "points' worth of residuals that a group may have above those of its own motion");
    v("region.agreement_share", c.region.agreement_share, 0.01, 10.0, "", "and as much of each of its points");
    v("region.reach_factor", c.region.reach_factor, 1.0, 100.0, "",
      "chi2 threshold from which a hypothesis is refined, times");
    v("region.group_inliers_start", c.region.group_inliers_start, 0.05, 1.0, "",
      "share of inliers expected in a rigid group");
    v("region.left_over_min", c.region.left_over_min, 3.0, 4000.0, "",
      "fewer points that agree with nobody propose no motion");
    v("region.left_over_inliers_start", c.region.left_over_inliers_start, 0.05, 1.0, "",
      "share of inliers expected among them");
    v("region.left_over_rounds", c.region.left_over_rounds, 0.0, 14.0, "", "motions sought among them");
    v("region.prior_weight", c.region.prior_weight, 0.0, 100.0, "", "of the expected motion beside Eq. 1");
    v("region.prior_sigmas", c.region.prior_sigmas, 0.1, 100.0, "",
      "off the expected motion, where that weight is half");
    v("region.plausible_sigmas", c.region.plausible_sigmas, 0.1, 100.0, "",
      "off the expected motion, where a score is half");
    v("region.same_motion_m", c.region.same_motion_m, 0.0, 1.0, "m", "closer motions are the same");
    v("region.same_motion_rad", c.region.same_motion_rad, 0.0, 1.0, "rad", "closer motions are the same");
    v("region.rival_area_min", c.region.rival_area_min, 0.0, 1.0, "",
      "share of the area only a rival explains; less is noise");
    v("region.anchor_inlier_factor", c.region.anchor_inlier_factor, 0.1, 100.0, "",
      "chi2 threshold at a point's anchor, times");
    v("region.more_factor", c.region.more_factor, 0.1, 100.0, "",
      "chi2 threshold once more of the map is matched, times");
    v("region.more_anchor_factor", c.region.more_anchor_factor, 0.1, 100.0, "", "the same at a point's anchor");
    v("region.more_radius_share", c.region.more_radius_share, 0.01, 10.0, "",
      "of matching.radius_px to look for more of the map in");
    v("pose.confidence", c.pose.confidence, 0.5, 0.9999, "", "of RANSAC's iteration rule");
    v("pose.coarse_iterations_max", c.pose.coarse_iterations_max, 1.0, 5000.0, "", "RANSAC iterations for one group");
    v("pose.final_iterations_max", c.pose.final_iterations_max, 1.0, 5000.0, "", "RANSAC iterations for the pose");
    v("pose.coarse_total_max", c.pose.coarse_total_max, 1.0, 20000.0, "", "RANSAC iterations of all groups together");
    v("pose.inliers_min", c.pose.inliers_min, 4.0, 1000.0, "", "fewer static inliers give no pose");
    v("pose.lost_frames_max", c.pose.lost_frames_max, 0.0, 1000.0, "frames", "how long a lost pose is predicted");
    v("pose.sure_sigma_m", c.pose.sure_sigma_m, 1e-4, 10.0, "m", "less certain motion over a second is unsure");
    v("pose.sure_sigma_rad", c.pose.sure_sigma_rad, 1e-4, 3.0, "rad", "less certain motion over a second is unsure");
    v("pose.sure_inliers_factor", c.pose.sure_inliers_factor, 1.0, 100.0, "",
      "times inliers_min inliers make a pose sure");
    v("pose.start_inliers_factor", c.pose.start_inliers_factor, 1.0, 100.0, "",
      "times inliers_min features with depth start a map");
    v("pose.coarse_factor", c.pose.coarse_factor, 1.0, 100.0, "", "RANSAC iterations over the rule's, for a group");
    v("pose.final_factor", c.pose.final_factor, 1.0, 100.0, "", "RANSAC iterations over the rule's, for the pose");
    v("pose.inlier_ratio_start", c.pose.inlier_ratio_start, 0.05, 1.0, "", "share of inliers expected at first");
    v("pose.inlier_ratio_min", c.pose.inlier_ratio_min, 0.05, 1.0, "", "least share of inliers the rule reckons with");
    v("pose.sample_chi2_max", c.pose.sample_chi2_max, 0.1, 1000.0, "",
      "largest squared change of a length between three points");
    v("pose.coarse_passes_max", c.pose.coarse_passes_max, 1.0, 100.0, "", "adjustment of a group's motion");
    v("pose.expected_passes_max", c.pose.expected_passes_max, 1.0, 100.0, "", "adjustment of the expected motion");
    v("pose.final_passes_max", c.pose.final_passes_max, 1.0, 100.0, "", "adjustment of the pose");
    v("weights.start", c.weights.start, 0.0, 200.0, "1/10", "static weight of a new point");
    v("weights.suspicious", c.weights.suspicious, 0.0, 200.0, "1/10", "the same inside a rejected group");
    v("weights.step", c.weights.step, 1.0, 100.0, "1/10", "theta, added or taken per frame");
    v("weights.max", c.weights.max, 1.0, 200.0, "1/10", "largest static weight");
    v("weights.eligible", c.weights.eligible, 0.0, 200.0, "1/10", "static threshold");
    v("weights.proven_s", c.weights.proven_s, 0.01, 100.0, "s",
      "a point is fully believed after standing still so long");
    v("weights.unproven", c.weights.unproven, 0.0, 1.0, "", "vote of a new point beside a proven one");
    v("weights.suspect_steps", c.weights.suspect_steps, 0.0, 200.0, "",
      "bad frames from the static threshold that take a vote");
    v("weights.anchor_age_s", c.weights.anchor_age_s, 0.01, 100.0, "s", "oldest anchor of a moving point");
    v("weights.anchor_proven_share", c.weights.anchor_proven_share, 0.0, 1.0, "",
      "of that age, standing still so long gives a vote");
    v("weights.drift_m", c.weights.drift_m, 0.0, 10.0, "m", "odometry since a point was first seen, at once");
    v("weights.drift_m_s", c.weights.drift_m_s, 0.0, 10.0, "m/s", "and with time");
    v("weights.drift_max_m", c.weights.drift_max_m, 0.0, 10.0, "m", "and at most");
    v("weights.drift_share", c.weights.drift_share, 0.0, 1.0, "",
      "and, for a point out of sight, by this share of the way (a radian counts as a metre)");
    v("weights.gain_min", c.weights.gain_min, 0.0, 1.0, "", "least share of a measurement in a point's place");
    v("weights.variance_min", c.weights.variance_min, 0.0, 1.0, "", "least variance of a point over one measurement's");
    v("weights.near_px", c.weights.near_px, 1.0, 400.0, "px", "a new feature is judged by its neighbours within");
    v("weights.near_m", c.weights.near_m, 0.0, 10.0, "m", "in depth, too, beside noise");
    v("weights.near_sigmas", c.weights.near_sigmas, 0.0, 100.0, "", "of depth noise between such neighbours");
    v("noise.pixel_start", c.noise.pixel_start, 1e-3, 1000.0, "", "variance of pixels over the model's, to begin with");
    v("noise.depth_start", c.noise.depth_start, 1e-3, 1000.0, "", "variance of depth over the model's, to begin with");
    v("noise.pixel_min", c.noise.pixel_min, 1e-3, 1.0, "", "least factor of the pixel variance");
    v("noise.depth_min", c.noise.depth_min, 1e-3, 1.0, "", "least factor of the depth variance");
    v("noise.max", c.noise.max, 1.0, 1000.0, "", "largest factor of either variance");
    v("noise.young_frames", c.noise.young_frames, 0.0, 1000.0, "frames",
      "learnt from each group under its own motion for so long");
    v("noise.explained_min", c.noise.explained_min, 0.0, 1.0, "",
      "share of voters; motions explain less: more noise is tried");
    v("noise.first_tries", c.noise.first_tries, 0.0, 10.0, "", "such tries in the first frame");
    v("noise.tries", c.noise.tries, 0.0, 10.0, "", "such tries in later frames");
    v("noise.pixel_try_factor", c.noise.pixel_try_factor, 1.0, 100.0, "", "more pixel noise from try to try");
    v("noise.depth_try_factor", c.noise.depth_try_factor, 1.0, 100.0, "", "more depth noise from try to try");
    v("noise.fall_young", c.noise.fall_young, 0.01, 1.0, "", "most a factor falls by in one of the first frames");
    v("noise.rise_young", c.noise.rise_young, 1.0, 100.0, "", "most a factor rises by in one of the first frames");
    v("noise.fall", c.noise.fall, 0.01, 1.0, "", "most a factor falls by in a frame");
    v("noise.rise", c.noise.rise, 1.0, 100.0, "", "most a factor rises by in a frame");
    v("noise.residuals_min", c.noise.residuals_min, 1.0, 4000.0, "", "fewer residuals tell nothing of noise");
    v("prediction.sigma_m", c.prediction.sigma_m, 1e-5, 10.0, "m", "deviation of the expected motion");
    v("prediction.sigma_m_s", c.prediction.sigma_m_s, 0.0, 100.0, "m/s", "its growth with the time between frames");
    v("prediction.sigma_rad", c.prediction.sigma_rad, 1e-5, 3.0, "rad", "deviation of the expected turn");
    v("prediction.sigma_rad_s", c.prediction.sigma_rad_s, 0.0, 100.0, "rad/s",
      "its growth with the time between frames");
    v("prediction.still_sigma_m", c.prediction.still_sigma_m, 1e-5, 10.0, "m", "deviation without a known velocity");
    v("prediction.still_sigma_m_s", c.prediction.still_sigma_m_s, 0.0, 100.0, "m/s",
      "its growth with the time between frames");
    v("prediction.still_sigma_rad", c.prediction.still_sigma_rad, 1e-5, 3.0, "rad",
      "deviation of the turn without a known velocity");
    v("prediction.still_sigma_rad_s", c.prediction.still_sigma_rad_s, 0.0, 100.0, "rad/s",
      "its growth with the time between frames");
    v("prediction.retry_sigma_factor", c.prediction.retry_sigma_factor, 1.0, 100.0, "",
      "less certain when the search had to be widened");
    v("prediction.turn_max_rad_s", c.prediction.turn_max_rad_s, 0.0, 100.0, "rad/s",
      "largest turn that is believed of the last frames");
    v("prediction.slip_share", c.prediction.slip_share, 0.0, 10.0, "",
      "of the lag between images that shows as depth error");
    v("prediction.gap_max", c.prediction.gap_max, 0.1, 100.0, "",
      "a velocity is used for so many times its own interval");
    v("prediction.fading_lost", c.prediction.fading_lost, 0.0, 1.0, "", "what is left of a velocity per lost frame");
    v("prediction.fading_frames_max", c.prediction.fading_frames_max, 0.0, 1000.0, "frames", "it fades for so long");
    v("prediction.fading_unsure", c.prediction.fading_unsure, 0.0, 1.0, "",
      "what is left of the sliding after an unsure frame");
    v("prediction.jump_sigmas", c.prediction.jump_sigmas, 0.0, 100.0, "",
      "an unsure pose farther off is doubted by the rest");
    v("prediction.goes_on_s", c.prediction.goes_on_s, 0.0, 100.0, "s",
      "a motion goes on for so long; an unsure pose later than that follows from nothing");
    v("prediction.acceleration_m_s2", c.prediction.acceleration_m_s2, 0.0, 1e4, "m/s2",
      "an unsure pose that takes more, since the last sure one, is refused");
    v("prediction.acceleration_rad_s2", c.prediction.acceleration_rad_s2, 0.0, 1e5, "rad/s2",
      "an unsure pose that takes more is refused");
    v("recovery.keyframes_max", c.recovery.keyframes_max, 1.0, 1000.0, "", "recent ones tried in turn");
    v("recovery.matches_min", c.recovery.matches_min, 3.0, 4000.0, "", "fewer matches recover nothing");
    v("recovery.inliers_start", c.recovery.inliers_start, 0.05, 1.0, "", "share of inliers expected");
    v("recovery.inlier_share_min", c.recovery.inlier_share_min, 0.0, 1.0, "", "of the matches that must agree");
    v("recovery.reach_m", c.recovery.reach_m, 0.0, 1000.0, "m", "how far a camera gets at once");
    v("recovery.reach_m_s", c.recovery.reach_m_s, 0.0, 1000.0, "m/s", "and how fast");
    v("recovery.reach_rad", c.recovery.reach_rad, 0.0, 10.0, "rad", "how far a camera turns at once");
    v("recovery.reach_rad_s", c.recovery.reach_rad_s, 0.0, 100.0, "rad/s", "and how fast");
    v("recovery.sigma_m", c.recovery.sigma_m, 1e-4, 10.0, "m", "how far the pose may be from where a place put it");
    v("recovery.sigma_rad", c.recovery.sigma_rad, 1e-4, 3.0, "rad",
      "how far the pose may be from where a place put it");
    v("recovery.probation_frames", c.recovery.probation_frames, 0.0, 300.0, "frames",
      "in which all agrees before a camera found again is believed");
    v("recovery.there_min", c.recovery.there_min, 0.0, 400.0, "", "points of the map whose depth is seen there");
    v("recovery.empty_share_max", c.recovery.empty_share_max, 0.0, 1.0, "", "of those whose place is seen to be empty");
    v("recovery.rival_share_max", c.recovery.rival_share_max, 0.0, 1.0, "",
      "another place looks at most so much like it as where a lost camera is taken to be");
    v("emptiness.places_per_frame", c.emptiness.places_per_frame, 0.0, 10000.0, "", "places looked at for emptiness");
    v("emptiness.reach_px", c.emptiness.reach_px, 1.0, 10.0, "px", "around a place, all must be empty");
    v("emptiness.sigmas", c.emptiness.sigmas, 0.0, 100.0, "", "of depth noise beyond a place that is empty");
    v("emptiness.margin_m", c.emptiness.margin_m, 0.0, 10.0, "m", "beyond it beside noise");
    v("emptiness.views", c.emptiness.views, 1.0, 255.0, "", "frames that see a place empty before its point goes");
    v("keyframes.tracked_share_max", c.keyframes.tracked_share_max, 0.05, 1.0, "", "track more: no new keyframe");
    v("keyframes.new_points_min", c.keyframes.new_points_min, 1.0, 4000.0, "", "a new keyframe adds at least so many");
    v("keyframes.gap_min", c.keyframes.gap_min, 1.0, 300.0, "frames", "from one keyframe to the next");
    v("keyframes.tracked_share_urgent", c.keyframes.tracked_share_urgent, 0.0, 1.0, "", "below: the gap is ignored");
    v("keyframes.tracked_urgent_permille", c.keyframes.tracked_urgent_permille, 0.0, 1000.0, "",
      "static points, of features.count; below: the gap is ignored");
    v("keyframes.gap_urgent", c.keyframes.gap_urgent, 1.0, 300.0, "frames", "the gap when it is ignored");
    v("keyframes.new_per_tracked", c.keyframes.new_per_tracked, 1.0, 100.0, "", "new points that count as one tracked");
    v("schedule.units_per_frame", c.schedule.units_per_frame, 1.0, 1e9, "units", "background work after each frame");
    v("schedule.slice_units", c.schedule.slice_units, 1.0, 1e9, "units", "background work in one piece");
    v("mapping.is_enabled", c.mapping.is_enabled, 0.0, 1.0, "", "a map that is refined; off: tracking alone");
    v("mapping.is_adjusting", c.mapping.is_adjusting, 0.0, 1.0, "", "local bundle adjustment");
    v("mapping.is_fusing", c.mapping.is_fusing, 0.0, 1.0, "", "fuse duplicates with neighbours");
    v("mapping.is_triangulating", c.mapping.is_triangulating, 0.0, 1.0, "", "points for features without depth");
    v("mapping.is_culling", c.mapping.is_culling, 0.0, 1.0, "", "forget redundant keyframes");
    v("mapping.settled_s", c.mapping.settled_s, 0.0, 1e9, "s",
      "keyframes older than a new one by so much are not moved by its adjustment");
    v("mapping.window_keyframes", c.mapping.window_keyframes, 2.0, 12.0, "", "free keyframes of an adjustment");
    v("mapping.shared_min", c.mapping.shared_min, 1.0, 4000.0, "", "points a neighbour shares");
    v("mapping.fixed_shared_min", c.mapping.fixed_shared_min, 1.0, 4000.0, "",
      "points a fixed keyframe shares with the window");
    v("mapping.adjusted_points_min", c.mapping.adjusted_points_min, 3.0, 4000.0, "",
      "a new keyframe that sees fewer points is not adjusted");
    v("mapping.chi2_max_pixel", c.mapping.chi2_max_pixel, 0.1, 1000.0, "",
      "largest squared residual of an observation without depth");
    v("mapping.chi2_max_depth", c.mapping.chi2_max_depth, 0.1, 1000.0, "", "the same with depth");
    v("mapping.first_iterations_max", c.mapping.first_iterations_max, 1.0, 100.0, "", "adjustment with outliers");
    v("mapping.second_iterations_max", c.mapping.second_iterations_max, 0.0, 100.0, "", "adjustment without them");
    v("mapping.triangulation_chi2_max", c.mapping.triangulation_chi2_max, 0.1, 1000.0, "",
      "largest squared distance from the epipolar line");
    v("mapping.parallax_cosine_max", c.mapping.parallax_cosine_max, 0.0, 1.0, "",
      "rays closer to parallel are not triangulated");
    v("mapping.triangulation_sigma_factor", c.mapping.triangulation_sigma_factor, 0.1, 100.0, "",
      "times depth.sigma_max_m is the least sure triangulated point");
    v("mapping.triangulation_keyframes", c.mapping.triangulation_keyframes, 0.0, 10.0, "",
      "neighbours to triangulate with");
    v("mapping.fusion_keyframes", c.mapping.fusion_keyframes, 0.0, 10.0, "", "neighbours to fuse with");
    v("mapping.fusion_radius_px", c.mapping.fusion_radius_px, 0.1, 100.0, "px", "duplicates are looked for within");
    v("mapping.fusion_hamming_max", c.mapping.fusion_hamming_max, 0.0, 256.0, "bits",
      "largest descriptor distance of duplicates");
    v("mapping.fusion_scale_factor", c.mapping.fusion_scale_factor, 1.0, 10.0, "", "off the expected scale");
    v("mapping.fusion_depth_chi2_max", c.mapping.fusion_depth_chi2_max, 0.1, 1000.0, "",
      "largest squared difference in depth");
    v("mapping.roomy_permille", c.mapping.roomy_permille, 0.0, 1000.0, "1/1000",
      "of the keyframes, below which redundant ones stay");
    v("mapping.spare_keyframes_permille", c.mapping.spare_keyframes_permille, 0.0, 500.0, "1/1000",
      "of the keyframes, kept free ahead of need");
    v("mapping.spare_points_permille", c.mapping.spare_points_permille, 0.0, 500.0, "1/1000",
      "of the points, kept free ahead of need");
    v("map.cull_after_frames", c.map.cull_after_frames, 1.0, 1e6, "frames", "weak points unseen for so long go");
    v("map.seen_min", c.map.seen_min, 1.0, 65535.0, "frames", "points seen in fewer are weak");
    v("map.crowded_m", c.map.crowded_m, 0.0, 100.0, "m", "keyframes with one as near go first");
    v("map.turn_m2", c.map.turn_m2, 0.0, 100.0, "m^2", "a turn is as far as its root: times 1 - cosine");
    v("map.redundant_observers", c.map.redundant_observers, 1.0, 1000.0, "", "others that see a point well enough");
    v("map.redundant_permille", c.map.redundant_permille, 1.0, 1000.0, "1/1000",
      "such points make a keyframe redundant");
    v("map.looks_max", c.map.looks_max, 1.0, 255.0, "frames",
      "a keyframe's measurement is the mean of at most so many");
    v("map.looks_reach", c.map.looks_reach, 0.0, 1.0, "", "looked from so near, over the depth, for that mean");
    v("map.redundant_scale_factor", c.map.redundant_scale_factor, 1.0, 10.0, "", "farther than this is not well");
    v("local_map.moved_m", c.local_map.moved_m, 0.0, 100.0, "m", "farther, and other points come into view");
    v("local_map.moved_cosine_min", c.local_map.moved_cosine_min, -1.0, 1.0, "", "turned further, likewise");
    v("local_map.near_m", c.local_map.near_m, 0.0, 100.0, "m", "a near viewpoint");
    v("local_map.near_cosine_min", c.local_map.near_cosine_min, -1.0, 1.0, "", "that looks the same way");
    v("local_map.turn_m2", c.local_map.turn_m2, 0.0, 100.0, "m^2", "a turn beside the distance, which is nearer");
    v("local_map.sharing_keyframes", c.local_map.sharing_keyframes, 1.0, 24.0, "", "that share most with the frame");
    v("local_map.near_keyframes", c.local_map.near_keyframes, 0.0, 24.0, "", "with near viewpoints");
    v("local_map.neighbours", c.local_map.neighbours, 0.0, 24.0, "", "of each keyframe taken in");
    v("local_map.shared_min", c.local_map.shared_min, 1.0, 4000.0, "", "points a neighbour shares");
    v("local_map.nearer_min", c.local_map.nearer_min, 0.0, 1.0, "",
      "share of a point's first distance, seen from nearer");
    v("local_map.farther_max", c.local_map.farther_max, 1.0, 100.0, "", "multiple of it, seen from farther");
    v("local_map.useful_factor", c.local_map.useful_factor, 1.0, 1000.0, "",
      "a keyframe that shares so many times less than the first is no use");
    v("loop.is_enabled", c.loop.is_enabled, 0.0, 1.0, "", "recognise places and close loops, given a vocabulary");
    v("loop.is_relocalising", c.loop.is_relocalising, 0.0, 1.0, "", "find a lost camera by the words of its picture");
    v("loop.is_adjusting", c.loop.is_adjusting, 0.0, 1.0, "", "global bundle adjustment after a loop");
    v("loop.consistency", c.loop.consistency, 0.0, 5.0, "", "queries before that must agree on a place");
    v("loop.score_share", c.loop.score_share, 0.0, 1.0, "", "of the least score among neighbours, for those");
    v("loop.distance_max_m", c.loop.distance_max_m, 0.01, 100.0, "m", "farther apart two views are no loop");
    v("loop.gap_frames", c.loop.gap_frames, 1.0, 1e6, "frames", "nearer in time two views are no loop");
    v("loop.settle_s", c.loop.settle_s, 0.0, 100.0, "s", "a keyframe is looked up when what it saw is so old");
    v("loop.rest_keyframes", c.loop.rest_keyframes, 0.0, 1000.0, "", "after a loop none is sought for so many");
    v("loop.candidates_max", c.loop.candidates_max, 1.0, 8.0, "", "places verified for one keyframe");
    v("loop.nodes_level", c.loop.nodes_level, 1.0, 8.0, "",
      "features under one node of this level of the vocabulary are compared");
    v("loop.hamming_max", c.loop.hamming_max, 1.0, 256.0, "bits", "largest descriptor distance of a match");
    v("loop.hamming_guided_max", c.loop.hamming_guided_max, 1.0, 256.0, "bits", "the same around a projection");
    v("loop.ratio_max", c.loop.ratio_max, 0.1, 1.0, "", "best to second best descriptor distance");
    v("loop.radius_px", c.loop.radius_px, 1.0, 100.0, "px", "search radius around a projection");
    v("loop.iterations_max", c.loop.iterations_max, 1.0, 5000.0, "", "RANSAC iterations for one candidate");
    v("loop.chi2_max", c.loop.chi2_max, 0.1, 1000.0, "", "largest squared residual of a point that agrees");
    v("loop.matches_min", c.loop.matches_min, 3.0, 4000.0, "", "fewer matches are no place");
    v("loop.first_inliers_min", c.loop.first_inliers_min, 3.0, 4000.0, "",
      "fewer that agree are not looked at further");
    v("loop.inliers_min", c.loop.inliers_min, 3.0, 4000.0, "", "fewer that agree after guided matching are no place");
    v("loop.spread_min", c.loop.spread_min, 0.0, 1.0, "", "share of width and of height that they span at least");
    v("loop.drift_m", c.loop.drift_m, 0.0, 1000.0, "m", "odometry can have drifted by so much");
    v("loop.drift_share", c.loop.drift_share, 0.0, 10.0, "", "and by this share of the path");
    v("loop.drift_lost_m_s", c.loop.drift_lost_m_s, 0.0, 100.0, "m/s", "and so fast while nothing was measured");
    v("loop.correction_min_m", c.loop.correction_min_m, 0.0, 10.0, "m", "a smaller correction is none");
    v("loop.correction_min_rad", c.loop.correction_min_rad, 0.0, 3.0, "rad", "a smaller correction is none");
    v("loop.correction_chi2_min", c.loop.correction_chi2_min, 0.0, 1e6, "",
      "one of fewer squared deviations of what verification measured is none either");
    v("store.regions_max", c.store.regions_max, 1.0, 1e6, "", "regions of the map store; full: the longest unused go");
    v("store.points_min", c.store.points_min, 3.0, 16000.0, "", "static points; a region with fewer is not kept");
    v("store.gap_frames", c.store.gap_frames, 1.0, 1e6, "frames", "regions nearer in time do not come back");
    v("store.pause_frames", c.store.pause_frames, 1.0, 1e6, "frames", "between two regions that come back");
    v("store.rest_frames", c.store.rest_frames, 1.0, 1e6, "frames", "a region that came back does not come sooner");
    v("store.patience_frames", c.store.patience_frames, 1.0, 1e6, "frames", "then an answer is given up");
    v("store.score_share", c.store.score_share, 0.0, 1.0, "", "of the least score among neighbours, to come back");
    v("store.lost_score_min", c.store.lost_score_min, 0.0, 1.0, "", "of a lost camera's picture, to come back");
    v("store.twin_m", c.store.twin_m, 0.0, 100.0, "m", "a place that is kept from so near is not kept again");
    v("store.twin_cosine_min", c.store.twin_cosine_min, -1.0, 1.0, "", "if it was looked at the same way");
    v("store.moved_m", c.store.moved_m, 0.0, 100.0, "m", "a region that moved by so much is kept anew");
    v("store.moved_rad", c.store.moved_rad, 0.0, 3.2, "rad", "or was turned by so much");
    v("seed", c.seed, 0.0, 9007199254740992.0, "", "of the random numbers");
}

}  // namespace stillmesh
