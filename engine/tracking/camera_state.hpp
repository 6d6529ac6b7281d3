// What is known of the camera from the frames before: where it is and how it moves, how far it can have got, what
// odometry has gathered, how noisy its measurements are, and how far all of that can be trusted. One value: a place
// that may be where a lost camera is gets tried on a copy, and what fails is put back whole. Cost of a copy: some 3 KB.
#pragma once

#include <cstdint>

#include "engine/geometry/se3.hpp"
#include "engine/parameters.hpp"
#include "engine/static_region/motion_hints.hpp"
#include "engine/static_region/static_region.hpp"
#include "engine/tracking/camera_reach.hpp"
#include "engine/tracking/motion_model.hpp"
#include "engine/tracking/noise_scale.hpp"
#include "engine/tracking/odometry.hpp"
#include "engine/tracking/pose_confidence.hpp"
#include "engine/tracking/rival_motion.hpp"
#include "engine/world/world.hpp"

namespace stillmesh {

struct CameraState {
    static constexpr void plan(ArenaPlan& arena, const Limits& limits) noexcept { NoiseScale::plan(arena, limits); }
    void create(Arena& arena, const Limits& limits, const Parameters& configuration) noexcept;
    // A camera that has seen nothing yet.
    void reset(const Parameters& configuration) noexcept;
    // In a new map, at rest; its odometry begins there. Without a place: at the origin.
    void begin_at(const SE3* place, std::int64_t time_ns) noexcept;
    // In a map that was made until `time_ns`; where, only a place that is recognised can say.
    void begin_in_map(std::int64_t time_ns, const Parameters& configuration) noexcept;

    // Where the motion leads until `time_ns`, and how surely; the lag between colour and depth is the frame's.
    [[nodiscard]] RegionContext expect(std::int64_t time_ns, double colour_depth_lag_s,
                                       const PredictionParameters& parameters) const noexcept;
    // What is expected weighs nothing beside a good frame, and keeps a poor one from inventing a jump.
    [[nodiscard]] bool has_prior() const noexcept { return motion.has_velocity() && lost_frames == 0; }
    // The map under the camera moved: the camera moves along.
    void follow(const CameraMove& move) noexcept;
    [[nodiscard]] const SE3& world_from_camera() const noexcept { return motion.world_from_camera(); }

    MotionModel motion;
    RivalMotion rival;  // of it
    CameraReach reach;
    MotionHints hints;
    Odometry odometry;
    NoiseScale noise;
    PoseConfidence confidence;
    double inlier_ratio = 0.5;          // of the last frame's matches, static ones
    std::int64_t measured_time_ns = 0;  // of the last pose that was measured
    std::int64_t start_time_ns = 0;     // from then on the past of points tells what moves
    std::uint32_t lost_frames = 0;      // since the last pose that was measured
    bool is_choice_sure = true;         // of the static region, in the last frame
    bool is_on_proven = false;          // most of what the last pose stands on had stood still before
    bool is_placed = true;              // false: in a map that was loaded, and not found there yet
};

}  // namespace stillmesh
