// Every number that a user may know: one line each, with its type, name, default, range, unit and effect. The lines
// make the struct, --print-config, the reference page, the check of ranges, and what a recording names. Numbers that
// belong to the method's inside stand beside their modules and are not installed.
#pragma once

#include <algorithm>
#include <cstdint>

#include "engine/base/parameter_table.hpp"
#include "engine/limits.hpp"

namespace stillmesh {

// clang-format off
#define STILLMESH_KEYS_camera(KEY) \
    KEY(camera, double, readout_s, -1, -1.0, 0.1, "s", "of a rolling shutter; 0: none; negative: estimated")
struct CameraParameters { STILLMESH_KEYS_camera(STILLMESH_FIELD) };

#define STILLMESH_KEYS_features(KEY) \
    KEY(features, std::uint32_t, count, 1000, 50.0, 4000.0, "", "features per frame, at most the limit of the preset") \
    KEY(features, std::uint32_t, levels, 8, 1.0, 12.0, "", "levels of the image pyramid") \
    KEY(features, double, scale_factor, 1.2, 1.2, 1.9, "", "from one pyramid level to the next") \
    KEY(features, std::uint32_t, fast_threshold, 20, 2.0, 120.0, "grey levels", "corner threshold") \
    KEY(features, std::uint32_t, fast_threshold_low, 7, 1.0, 120.0, "grey levels", "corner threshold where a cell has no corner otherwise")
struct FeatureParameters { STILLMESH_KEYS_features(STILLMESH_FIELD) };

#define STILLMESH_KEYS_depth(KEY) \
    KEY(depth, double, sigma_z_per_m2, 1.425e-3, 1e-5, 0.1, "1/m", "depth noise: sigma = this * z^2") \
    KEY(depth, double, sigma_pixel, 1.0, 0.05, 10.0, "px", "noise of a feature's position at level 0") \
    KEY(depth, double, z_min_m, 0.3, 0.05, 5.0, "m", "nearest depth that is used") \
    KEY(depth, double, z_max_m, 6.0, 0.5, 50.0, "m", "farthest depth that is used") \
    KEY(depth, double, sigma_max_m, 0.15, 0.001, 5.0, "m", "features with a larger depth deviation are isolated")
struct DepthParameters { STILLMESH_KEYS_depth(STILLMESH_FIELD) };

// How the static region is extracted: region.method.
enum class RegionMethod : std::uint32_t {
    kOurs = 0,   // hypotheses of groups, prediction and past, weighed by what the past knows of each point
    kPaper = 1,  // the paper to the letter, to measure what we left it for
};
#define STILLMESH_KEYS_region(KEY) \
    KEY(region, bool, is_enabled, true, 0.0, 1.0, "", "extract the static region; off: all matches count") \
    KEY(region, std::uint32_t, method, 0, 0.0, 1.0, "", "0: ours; 1: the paper to the letter") \
    KEY(region, double, edge_change_max_m, 0.1, 0.001, 5.0, "m", "largest change of a kept edge (tau)") \
    KEY(region, double, colour_depth_lag_s, 0.010, 0.0, 0.1, "s", "between colour and depth images") \
    KEY(region, double, score_min, 0.2, 0.0, 1.0, "", "smaller score of the choice makes a pose unsure")
struct RegionKeys { STILLMESH_KEYS_region(STILLMESH_FIELD) };

#define STILLMESH_KEYS_pose(KEY) \
    KEY(pose, std::uint32_t, inliers_min, 8, 4.0, 1000.0, "", "fewer static inliers give no pose") \
    KEY(pose, std::uint32_t, lost_frames_max, 30, 0.0, 1000.0, "frames", "how long a lost pose is predicted") \
    KEY(pose, double, sure_sigma_m, 0.03, 1e-4, 10.0, "m or rad", "less certain motion over a second is unsure") \
    KEY(pose, double, stray_m, 0.03, 0.0, 1000.0, "m", "unsure poses farther off the line between sure ones make the second after them unsure")
struct PoseKeys { STILLMESH_KEYS_pose(STILLMESH_FIELD) };

#define STILLMESH_KEYS_weights(KEY) \
    KEY(weights, std::uint32_t, max, 20, 1.0, 200.0, "1/10", "largest static weight") \
    KEY(weights, std::uint32_t, eligible, 10, 0.0, 200.0, "1/10", "static threshold, and the weight of a new point")
struct WeightKeys { STILLMESH_KEYS_weights(STILLMESH_FIELD) };

#define STILLMESH_KEYS_prediction(KEY) \
    KEY(prediction, double, acceleration_m_s2, 10.0, 0.0, 1e4, "m/s2", "an unsure pose that takes more, since the last sure one, is refused") \
    KEY(prediction, double, acceleration_rad_s2, 60.0, 0.0, 1e5, "rad/s2", "an unsure pose that takes more is refused")
struct PredictionKeys { STILLMESH_KEYS_prediction(STILLMESH_FIELD) };

#define STILLMESH_KEYS_recovery(KEY) \
    KEY(recovery, double, reach_m_s, 1.5, 0.0, 1000.0, "m/s", "and how fast") \
    KEY(recovery, double, reach_rad_s, 2.0, 0.0, 100.0, "rad/s", "and how fast") \
    KEY(recovery, std::uint32_t, probation_frames, 8, 0.0, 300.0, "frames", "in which all agrees before a camera found again is believed")
struct RecoveryKeys { STILLMESH_KEYS_recovery(STILLMESH_FIELD) };

#define STILLMESH_KEYS_keyframes(KEY) \
    KEY(keyframes, double, tracked_share_max, 0.8, 0.05, 1.0, "", "track more: no new keyframe") \
    KEY(keyframes, std::uint32_t, new_points_min, 40, 1.0, 4000.0, "", "a new keyframe adds at least so many") \
    KEY(keyframes, std::uint32_t, gap_min, 8, 1.0, 300.0, "frames", "from one keyframe to the next")
struct KeyframeKeys { STILLMESH_KEYS_keyframes(STILLMESH_FIELD) };

// Background work in work units (engine/schedule/task.hpp).
#define STILLMESH_KEYS_schedule(KEY) \
    KEY(schedule, std::uint32_t, units_per_frame, 20000, 1.0, 1e9, "units", "background work after each frame") \
    KEY(schedule, std::uint32_t, slice_units, 2000, 1.0, 1e9, "units", "background work in one piece")
struct ScheduleParameters { STILLMESH_KEYS_schedule(STILLMESH_FIELD) };

#define STILLMESH_KEYS_mapping(KEY) \
    KEY(mapping, bool, is_enabled, true, 0.0, 1.0, "", "a map that is refined; off: tracking alone") \
    KEY(mapping, bool, is_adjusting, true, 0.0, 1.0, "", "local bundle adjustment") \
    KEY(mapping, std::uint32_t, window_keyframes, 10, 2.0, 12.0, "", "free keyframes of an adjustment")
struct MappingKeys { STILLMESH_KEYS_mapping(STILLMESH_FIELD) };

#define STILLMESH_KEYS_loop(KEY) \
    KEY(loop, bool, is_enabled, true, 0.0, 1.0, "", "recognise places and close loops, given a vocabulary") \
    KEY(loop, bool, is_relocalising, true, 0.0, 1.0, "", "find a lost camera by the words of its picture") \
    KEY(loop, bool, is_adjusting, true, 0.0, 1.0, "", "global bundle adjustment after a loop") \
    KEY(loop, std::uint32_t, consistency, 5, 0.0, 5.0, "", "queries before that must agree on a place") \
    KEY(loop, double, distance_max_m, 1.5, 0.01, 100.0, "m", "farther apart two views are no loop") \
    KEY(loop, std::uint32_t, gap_frames, 150, 1.0, 1e6, "frames", "nearer in time two views are no loop") \
    KEY(loop, std::uint32_t, inliers_min, 40, 3.0, 4000.0, "", "fewer that agree after guided matching are no place") \
    KEY(loop, double, drift_share, 0.05, 0.0, 10.0, "", "and by this share of the path")
struct LoopKeys { STILLMESH_KEYS_loop(STILLMESH_FIELD) };

#define STILLMESH_KEYS_store(KEY) \
    KEY(store, std::uint32_t, regions_max, 20000, 1.0, 1e6, "", "regions of the map store; full: the longest unused go") \
    KEY(store, std::uint32_t, gap_frames, 150, 1.0, 1e6, "frames", "regions nearer in time do not come back, and none twice; an answer that takes longer is given up") \
    KEY(store, double, twin_m, 0.3, 0.0, 100.0, "m", "a place that is kept from a view so near is not kept again")
struct StoreKeys { STILLMESH_KEYS_store(STILLMESH_FIELD) };

// All of them, in this order.
#define STILLMESH_ALL_KEYS(KEY) \
    STILLMESH_KEYS_camera(KEY) STILLMESH_KEYS_features(KEY) STILLMESH_KEYS_depth(KEY) STILLMESH_KEYS_region(KEY) \
    STILLMESH_KEYS_pose(KEY) STILLMESH_KEYS_weights(KEY) STILLMESH_KEYS_prediction(KEY) STILLMESH_KEYS_recovery(KEY) \
    STILLMESH_KEYS_keyframes(KEY) STILLMESH_KEYS_schedule(KEY) STILLMESH_KEYS_mapping(KEY) STILLMESH_KEYS_loop(KEY) \
    STILLMESH_KEYS_store(KEY)

// clang-format on

struct Configuration {
    CameraParameters camera;
    FeatureParameters features;
    DepthParameters depth;
    RegionKeys region;
    PoseKeys pose;
    WeightKeys weights;
    PredictionKeys prediction;
    RecoveryKeys recovery;
    KeyframeKeys keyframes;
    ScheduleParameters schedule;
    MappingKeys mapping;
    LoopKeys loop;
    StoreKeys store;
    std::uint64_t seed = 1;  // of RANSAC

    [[nodiscard]] static constexpr Configuration indoor() noexcept { return {}; }
    [[nodiscard]] static constexpr Configuration outdoor() noexcept {
        Configuration out;
        out.region.edge_change_max_m = 0.5;
        out.loop.distance_max_m = 3.0;
        return out;
    }
    // The same with the three keys that have to be within the limits brought down to them, so that validate() takes
    // it: Configuration::outdoor().fitted_to(Limits::pocket()).
    [[nodiscard]] constexpr Configuration fitted_to(const Limits& limits) const noexcept {
        Configuration out = *this;
        out.features.count = std::min(out.features.count, limits.features_max);
        out.features.levels = std::min(out.features.levels, limits.pyramid_levels_max);
        out.mapping.window_keyframes = std::min(out.mapping.window_keyframes, limits.keyframes_max);
        return out;
    }
    // The defaults, as far as these limits have room for them.
    [[nodiscard]] static constexpr Configuration for_limits(const Limits& limits) noexcept {
        return Configuration().fitted_to(limits);
    }
};

// Calls visitor(name, value, min, max, unit, sentence) for every key; value is a reference to bool, std::uint32_t,
// std::uint64_t or double, min and max are doubles.
template <typename Visitor>
constexpr void visit_parameters(Configuration& c, Visitor&& v) {
    STILLMESH_ALL_KEYS(STILLMESH_VISIT)
    v("seed", c.seed, 0.0, 9007199254740992.0, "", "of the random numbers");
}

}  // namespace stillmesh
