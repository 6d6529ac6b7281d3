#include "engine/tracking/camera_reach.hpp"

#include <algorithm>

#include "engine/base/time.hpp"

namespace stillmesh {

// Two frames a nanosecond apart give a speed of any size; half a turn on, it says nothing.
constexpr double kTurnMax_rad = 3.14;

void CameraReach::begin(const SE3& world_from_camera, std::int64_t time_ns) noexcept {
    world_from_camera_ = world_from_camera;
    velocity_.setZero();
    time_ns_ = time_ns;
}

void CameraReach::note(const MotionModel& motion, bool has_velocity, std::int64_t time_ns) noexcept {
    begin(motion.world_from_camera(), time_ns);
    const double dt = seconds_between(motion.time_ns(), time_ns);
    if (has_velocity && dt > 0)
        velocity_ = se3_log(motion.world_from_camera_previous().inverse() * motion.world_from_camera()) / dt;
}

void CameraReach::follow(const SE3& correction) noexcept {
    world_from_camera_ = correction * world_from_camera_;
    renormalise(world_from_camera_.rotation);
}

bool CameraReach::holds(const SE3& world_from_camera, std::int64_t time_ns,
                        const Parameters& configuration) const noexcept {
    const RecoveryParameters& r = configuration.recovery;
    const PredictionParameters& p = configuration.prediction;
    const double away_s = seconds_between(time_ns_, time_ns);
    const double goes_on_s = std::min({away_s, p.goes_on_s, kTurnMax_rad / std::max(velocity_.tail<3>().norm(), 1e-9)});
    const SE3 expected = world_from_camera_ * se3_exp(velocity_ * goes_on_s);
    const SE3 off = expected.inverse() * world_from_camera;
    const auto reach = [&](double at_once, double speed, double acceleration) {
        return at_once + std::min(speed * away_s, 0.5 * acceleration * away_s * away_s);
    };
    const double reach_m = reach(r.reach_m, r.reach_m_s, p.acceleration_m_s2);
    return off.translation.squaredNorm() <= reach_m * reach_m &&
           rotation_angle(off.rotation) <= reach(r.reach_rad, r.reach_rad_s, p.acceleration_rad_s2);
}

}  // namespace stillmesh
