#include "engine/tracking/tracked_shutter.hpp"

#include <algorithm>

namespace stillmesh {
namespace {

constexpr double kTurnMax_rad = 0.1;  // 200 degrees per second, read within 28 ms

}  // namespace

void TrackedShutter::reset() noexcept {
    shutter_.reset();
    speed_ = sweep_ = Vector6::Zero();
    has_turn_ = false;
    turn_variance_ = parameters_.turn_start_rad * parameters_.turn_start_rad;
    turn_slow_variance_ = turn_variance_ / 2;
    off_before_ = measured_off_ = Vector3::Zero();
    turns_ = 0;
    pose_by_readout_ = Vector6::Zero();
    pose_by_readout_previous_ = Vector6::Zero();
}

void TrackedShutter::begin_in(Map& map) noexcept {
    shutter_.start_from(map.readout_s());
    if (shutter_.readout_s() != map.readout_s()) map.express_with_readout(shutter_.readout_s());  // it is given
}

Vector3 TrackedShutter::by_readout(const SE3& world_from_camera, const Vector3& p, float y_px) const noexcept {
    const Vector3 turning(pose_by_readout_(3), pose_by_readout_(4), pose_by_readout_(5));
    const Vector3 in_camera = shutter_.by_readout(p, static_cast<double>(y_px), speed_) + turning.cross(p) +
                              Vector3(pose_by_readout_(0), pose_by_readout_(1), pose_by_readout_(2));
    return world_from_camera.rotation * in_camera;
}

void TrackedShutter::set_motion(const SE3& camera_motion, double duration_s) noexcept {
    speed_ = se3_log(camera_motion) / duration_s;
    sweep_ = speed_ * shutter_.readout_s();
    if (has_turn_) sweep_.tail<3>() = turn_.turn;
}

bool TrackedShutter::measure_turn(std::span<const Correspondence> correspondences,
                                  std::span<const std::uint16_t> chosen, const SE3& world_from_camera,
                                  double chi2_max) noexcept {
    if (chosen.size() < parameters_.matches_min || !(parameters_.turn_start_rad > 0)) return false;
    const RowTurnPrior prior{sweep_.tail<3>(), expected_turn(), turn_variance_};
    const Result<RowTurn> measured = measure_row_turn(correspondences, chosen, world_from_camera, prior, chi2_max);
    if (!measured.is_ok()) return false;
    const RowTurn& found = measured.value();
    if (!(found.turn.squaredNorm() <= kTurnMax_rad * kTurnMax_rad)) return false;
    // What changes from frame to frame is the camera's; what stays is the map's, whose points were carried otherwise.
    const double share = 1.0 - std::clamp(turn_slow_variance_ / turn_variance_, 0.0, 1.0);
    measured_off_ = found.turn - expected_turn();
    turn_ = {expected_turn() + measured_off_ * share, found.covariance};
    sweep_.tail<3>() = turn_.turn;
    has_turn_ = true;
    return true;
}

// What this frame says of the variances, averaged with those before.
void TrackedShutter::learn_turn() noexcept {
    Vector3 off = measured_off_;
    const Vector3 turning = speed_.tail<3>();
    const double square = turning.squaredNorm();
    // Along the motion the readout may be what is off.
    if (square > 0) off -= turning * (turning.dot(off) / square);
    ++turns_;
    const double weight = std::max(1.0 / (turns_ + 1.0), 1.0 - parameters_.fading);
    turn_variance_ += weight * (off.squaredNorm() / 2.0 + turn_.covariance.trace() / 3.0 - turn_variance_);
    turn_variance_ = std::max(turn_variance_, RollingShutter::kPinned);
    turn_slow_variance_ += weight * (off.dot(off_before_) / 2.0 - turn_slow_variance_);
    off_before_ = off;
}

void TrackedShutter::learn(const MeasuredFrame& frame, const Map& map, std::span<const Correspondence> correspondences,
                           std::span<const std::uint16_t> chosen, const SE3& world_from_camera, double chi2_max,
                           bool counts) noexcept {
    if (counts && has_turn_) learn_turn();
    if (!shutter_.is_estimated()) return;
    const SE3 camera_from_world = world_from_camera.inverse();
    if (has_turn_)
        shutter_.begin_frame(turn_.turn - expected_turn(), turn_variance_);
    else
        shutter_.begin_frame();
    for (const std::uint16_t i : chosen) {
        const Correspondence& c = correspondences[i];
        const MapPoint& point = map.points().at(c.point_slot);
        shutter_.add(c, camera_from_world * c.p_world, camera_from_world.rotation * vector_of(point.world_by_readout),
                     static_cast<double>(frame.keypoint(c.feature).y), speed_, chi2_max);
    }
    pose_by_readout_previous_ = pose_by_readout_;
    pose_by_readout_ = shutter_.end_frame(counts);
}

void TrackedShutter::backdate(Map& map, std::int64_t start_time_ns) const noexcept {
    const Handle<Keyframe> first = map.recent_keyframe(0);
    if (first.is_null() || map.keyframes().find(first)->time_ns != start_time_ns) return;
    Keyframe& keyframe = *map.keyframes().find(first);
    keyframe.speed = speed_;
    keyframe.readout_s = shutter_.readout_s();
    for (const Observation& o : map.observations(first)) {
        MapPoint* const point = map.points().find(o.point);
        if (point == nullptr || point->created_ns != start_time_ns) continue;
        const Vector3 moves = keyframe.world_from_camera.rotation *
                              shutter_.by_readout(keyframe.world_from_camera.inverse() * vector_of(point->world),
                                                  static_cast<double>(o.y), speed_);
        store(moves, point->world_by_readout);
        store(moves, point->anchor_by_readout);
    }
}

void TrackedShutter::adopt(Map& map, MotionModel& motion) noexcept {
    const double before_s = shutter_.readout_s();
    if (!shutter_.adopt()) return;
    const double change_s = shutter_.readout_s() - before_s;
    map.express_with_readout(shutter_.readout_s());
    motion.amend(se3_exp(pose_by_readout_ * change_s), se3_exp(pose_by_readout_previous_ * change_s));
}

}  // namespace stillmesh
