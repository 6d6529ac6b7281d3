#include "engine/tracking/motion_model.hpp"

#include <algorithm>
#include <cmath>

#include "engine/base/time.hpp"

namespace stillmesh {
namespace {

constexpr double kNothing = 1e-9;  // share of a velocity; what is left is taken for it

}  // namespace

void MotionModel::begin_at(const SE3& world_from_camera) noexcept {
    world_from_camera_ = world_from_camera_previous_ = world_from_camera;
    has_velocity_ = false;
}

void MotionModel::begin_after(std::int64_t time_ns) noexcept {
    time_ns_ = previous_time_ns_ = time_ns;
    has_velocity_ = false;
}

MotionModel::Prediction MotionModel::predict(std::int64_t time_ns, const PredictionParameters& parameters,
                                             std::uint32_t lost_frames, bool is_choice_sure) const noexcept {
    const PredictionParameters& p = parameters;
    Prediction out;
    out.world_from_camera = world_from_camera_;
    const double dt = seconds_between(time_ns_, time_ns);
    if (has_velocity_) {
        const double before = seconds_between(previous_time_ns_, time_ns_);
        Vector6 xi = se3_log(world_from_camera_previous_.inverse() * world_from_camera_);
        out.rotation_speed_rad_s = std::sqrt(Vector3(xi.tail<3>()).squaredNorm()) / before;
        // What was not measured fades: a camera does not turn at the same speed for long.
        double factor = std::min(dt / before, p.gap_max);
        for (std::uint32_t i = 0; i < lost_frames && factor > kNothing; ++i) factor *= p.fading;
        xi *= factor;
        // Nor does it slide on for long; a turn goes on longer.
        if (!is_choice_sure) {
            for (int i = 0; i < 3; ++i) xi(i) *= p.fading;
        }
        out.world_from_camera = world_from_camera_ * se3_exp(xi);
    }
    out.sigma_m = has_velocity_ ? p.sigma_m + p.sigma_m_s * dt : p.still_sigma_m + p.still_sigma_m_s * dt;
    out.sigma_rad = p.sigma_rad + (has_velocity_ ? p.sigma_rad_s : p.still_sigma_rad_s) * dt;
    return out;
}

void MotionModel::move_to(const SE3& world_from_camera) noexcept {
    world_from_camera_previous_ = world_from_camera_;
    world_from_camera_ = world_from_camera;
}

void MotionModel::end_frame(std::int64_t time_ns) noexcept {
    previous_time_ns_ = time_ns_;
    time_ns_ = time_ns;
}

void MotionModel::follow(const SE3& correction) noexcept {
    for (SE3* const pose : {&world_from_camera_, &world_from_camera_previous_}) {
        *pose = correction * *pose;
        renormalise(pose->rotation);
    }
}

void MotionModel::amend(const SE3& change, const SE3& change_previous) noexcept {
    world_from_camera_ = world_from_camera_ * change;
    world_from_camera_previous_ = world_from_camera_previous_ * change_previous;
    renormalise(world_from_camera_.rotation);
    renormalise(world_from_camera_previous_.rotation);
}

}  // namespace stillmesh
