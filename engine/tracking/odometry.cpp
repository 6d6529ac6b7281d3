#include "engine/tracking/odometry.hpp"

#include <cmath>

#include "engine/geometry/se3.hpp"

namespace stillmesh {

void Odometry::jump(const SE3& correction) noexcept {
    map_from_odom_ = correction * map_from_odom_;
    renormalise(map_from_odom_.rotation);
    has_jumped_ = true;
}

void Odometry::jump_to(const SE3& found, const SE3& world_from_camera) noexcept {
    map_from_odom_ = found * (map_from_odom_.inverse() * world_from_camera).inverse();
    renormalise(map_from_odom_.rotation);
    has_jumped_ = true;
}

void Odometry::split(const SE3& world_from_camera, PoseEstimate& pose) const noexcept {
    if (has_jumped_) {
        pose.odom_from_camera = transform_of(map_from_odom_.inverse() * world_from_camera);
        pose.map_from_odom = transform_of(map_from_odom_);
    } else {
        pose.map_from_odom = RigidTransform{};  // a jump may have been taken back
        pose.odom_from_camera = transform_of(world_from_camera);
    }
}

void Odometry::gather_drift(PoseState state, const MotionModel& motion, std::int64_t time_ns,
                            const Parameters& parameters) noexcept {
    if (state >= PoseState::kUnsure) {
        const SE3 step = motion.world_from_camera_previous().inverse() * motion.world_from_camera();
        const double step_m = std::sqrt(step.translation.squaredNorm());
        const double share = state == PoseState::kTracked ? 1.0 : 3.0;
        drift_m_ += share * parameters.loop.drift_share * step_m;
        travelled_ += step_m + rotation_angle(step.rotation);
    } else {
        drift_m_ += parameters.recovery.reach_m_s * static_cast<double>(time_ns - motion.time_ns()) * 1e-9;
    }
}

}  // namespace stillmesh
