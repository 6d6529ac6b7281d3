#include "hal/live/moved_depth_camera.hpp"

#include <algorithm>
#include <cmath>

namespace stillmesh {
namespace {

constexpr double kApartMax_s = 0.1;  // two poses: behind a gap nobody knows how the camera moves
constexpr double kMoveMin_px = 0.1;  // at kNearest_m
constexpr double kNearest_m = 0.5;
constexpr double kTurnMax_rad = 0.1;

// Of a rotation: axis and angle in one, rad per unit of the quaternion's vector.
[[nodiscard]] double radians_per_sine(const double (&xyzw)[4]) noexcept {
    const double sine = std::hypot(xyzw[0], xyzw[1], xyzw[2]);
    const double sign = xyzw[3] < 0 ? -1 : 1;
    return sine > 0 ? 2 * sign * std::atan2(sine, sign * xyzw[3]) / sine : 0;
}

}  // namespace

MovedDepthCamera::MovedDepthCamera(DepthCamera& source)
    : source_(source),
      model_(source.info().model),
      registration_(model_, model_, RigidTransform{}, source.info().depth_units_per_m),
      depth_(std::size_t{model_.width} * model_.height) {}

void MovedDepthCamera::learn(std::int64_t time_ns, const std::optional<RigidTransform>& odom_from_camera) noexcept {
    const double s = static_cast<double>(time_ns - last_ns_) * 1e-9;
    speed_ = {};
    if (odom_from_camera && last_ && s > 0 && s < kApartMax_s) {
        const RigidTransform step = compose(inverse_of(*odom_from_camera), *last_);
        const double scale = radians_per_sine(step.rotation_xyzw);
        for (std::size_t i = 0; i < 3; ++i) {
            speed_.rad_per_s[i] = scale * step.rotation_xyzw[i] / s;
            speed_.m_per_s[i] = step.translation_m[i] / s;
        }
    }
    last_ns_ = time_ns;
    last_ = odom_from_camera;
}

Status MovedDepthCamera::poll(Frame& frame) noexcept {
    STILLMESH_TRY(source_.poll(frame));
    const double since_s = static_cast<double>(frame.time_ns - last_ns_) * 1e-9;
    if (frame.depth_time_ns <= 0 || since_s > kApartMax_s) return Status::kOk;
    if (frame.depth.width != model_.width || frame.depth.height != model_.height) return Status::kOk;
    const double s = static_cast<double>(frame.time_ns - frame.depth_time_ns) * 1e-9;
    const double turn_rad = s * std::hypot(speed_.rad_per_s[0], speed_.rad_per_s[1], speed_.rad_per_s[2]);
    const double way_m = s * std::hypot(speed_.m_per_s[0], speed_.m_per_s[1], speed_.m_per_s[2]);
    const double moved_px = std::max(model_.fx, model_.fy) * std::abs(turn_rad + way_m / kNearest_m);
    if (moved_px < kMoveMin_px || std::abs(turn_rad) > kTurnMax_rad) return Status::kOk;
    RigidTransform motion;
    const double scale = turn_rad != 0 ? s * std::sin(turn_rad / 2) / turn_rad : 0;
    for (std::size_t i = 0; i < 3; ++i) {
        motion.rotation_xyzw[i] = scale * speed_.rad_per_s[i];
        motion.translation_m[i] = s * speed_.m_per_s[i];
    }
    motion.rotation_xyzw[3] = std::cos(turn_rad / 2);
    registration_.set_pose(motion);
    registration_.reproject(frame.depth, depth_.data());
    frame.depth = {depth_.data(), model_.width, model_.height, model_.width};
    return Status::kOk;
}

}  // namespace stillmesh
