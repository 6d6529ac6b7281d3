#include "engine/tracking/camera_state.hpp"

namespace stillmesh {

void CameraState::create(Arena& arena, const Limits& limits, const Parameters& configuration) noexcept {
    noise.create(arena, limits, configuration.noise);
    confidence.create(configuration);
    reset(configuration);
}

void CameraState::reset(const Parameters& configuration) noexcept {
    motion.reset();
    rival.reset();
    reach.begin(SE3{}, 0);
    hints.reset();
    odometry.reset();
    noise.reset();
    confidence.reset();
    inlier_ratio = configuration.pose.inlier_ratio_start;
    measured_time_ns = start_time_ns = 0;
    lost_frames = 0;
    is_choice_sure = true;
    is_on_proven = false;
    is_placed = true;
}

void CameraState::begin_at(const SE3* place, std::int64_t time_ns) noexcept {
    const SE3 world_from_camera = place != nullptr ? *place : SE3{};
    motion.begin_at(world_from_camera);
    rival.reset();
    reach.begin(world_from_camera, time_ns);
    hints.begin(world_from_camera, time_ns);
    if (place != nullptr) odometry.jump(world_from_camera);
    measured_time_ns = start_time_ns = time_ns;
    is_choice_sure = true;
    is_on_proven = false;
    lost_frames = 0;
}

void CameraState::begin_in_map(std::int64_t time_ns, const Parameters& configuration) noexcept {
    motion.begin_after(time_ns);
    rival.reset();
    confidence.begin_in_map();
    measured_time_ns = start_time_ns = time_ns;
    is_choice_sure = true;
    is_on_proven = false;
    is_placed = false;
    lost_frames = configuration.pose.lost_frames_max + 1;  // no motion is carried on into another map
}

RegionContext CameraState::expect(std::int64_t time_ns, double colour_depth_lag_s,
                                  const PredictionParameters& parameters) const noexcept {
    const MotionModel::Prediction motion_expected = motion.predict(time_ns, parameters, lost_frames, is_choice_sure);
    RegionContext out;
    out.world_from_camera_predicted = motion_expected.world_from_camera;
    out.prediction_sigma_m = motion_expected.sigma_m;
    out.prediction_sigma_rad = motion_expected.sigma_rad;
    out.rotation_speed_rad_s = motion_expected.rotation_speed_rad_s;
    out.colour_depth_lag_s = colour_depth_lag_s;
    out.inlier_ratio = inlier_ratio;
    out.has_prediction = true;
    out.travelled = odometry.travelled();
    out.rival_frames = rival.frames();
    if (rival.is_carried()) out.world_from_camera_rival = rival.predict(time_ns, parameters);
    return out;
}

void CameraState::follow(const CameraMove& move) noexcept {
    if (!move.is_any) return;
    motion.follow(move.correction);
    rival.follow(move.correction);
    reach.follow(move.correction);
    hints.follow(move.correction);
    if (move.has_jumped) odometry.jump(move.jump);
}

}  // namespace stillmesh
