#include "engine/tracking/tracked_shutter.hpp"

#include <algorithm>

namespace stillmesh {
namespace {

constexpr double kSteadyFrames = 8;  // of 30 a second: a trembling of 10 Hz is down to .08
// m/s, rad/s: 1100 degrees per second. Faster is no camera but two stamps that lie too close; its points would move
// faster with the readout than a map file may say.
constexpr double kSpeedMax = 20;
constexpr double kReadoutTurnMax_rad = 0.1;  // 200 degrees per second, read within 28 ms

}  // namespace

void TrackedShutter::reset() noexcept {
    shutter_.reset();
    speed_ = sweep_ = Vector6::Zero();
    steady_turning_ = turn_ = Vector3::Zero();
    trembling_ = Trembling(parameters_.fading);
    is_measured_ = has_turn_ = false;
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
    if (!(speed_.norm() <= kSpeedMax)) speed_.setZero();
    sweep_ = speed_ * shutter_.readout_s();
    if (has_turn_) sweep_.tail<3>() = turn_;
}

bool TrackedShutter::measure_turn(std::span<const Correspondence> correspondences,
                                  std::span<const std::uint16_t> chosen, const SE3& world_from_camera,
                                  double chi2_max) noexcept {
    const double variance = parameters_.turn_sigma_rad * parameters_.turn_sigma_rad;
    const bool has_rows = shutter_.is_estimated() || shutter_.readout_s() > 0;
    if (!has_rows || chosen.size() < parameters_.matches_min || !(variance > 0)) return false;
    const RowTurnPrior prior{sweep_.tail<3>(), expected_turn(), variance};
    const Result<RowTurn> measured = measure_row_turn(correspondences, chosen, world_from_camera, prior, chi2_max);
    if (!measured.is_ok() || !(measured.value().turn.norm() <= kReadoutTurnMax_rad)) return false;
    turn_ = measured.value().turn;
    off_ = turn_ - expected_turn();
    off_variance_ = measured.value().covariance.trace() / 3.0;
    is_measured_ = off_variance_ < variance / 2.0;  // more than half measured, not expected
    if (!is_trembling()) return false;
    sweep_.tail<3>() = turn_;
    has_turn_ = true;
    return true;
}

void TrackedShutter::learn_turn() noexcept {
    const Vector3 turning = speed_.tail<3>();
    const bool was_trembling = is_trembling();
    trembling_.note(off_, off_variance_, turning);
    if (!is_trembling()) return;
    if (!was_trembling) shutter_.doubt();  // its rows were taken for those of a steady motion
    if (!has_turn_) return;
    const double info = 1.0 / trembling_.variance();
    shutter_.add_turn(steady_turning_.dot(turn_) * info, steady_turning_.dot(turning) * info);
}

void TrackedShutter::learn(const MeasuredFrame& frame, const Map& map, std::span<const Correspondence> correspondences,
                           std::span<const std::uint16_t> chosen, const SE3& world_from_camera, double chi2_max,
                           bool counts) noexcept {
    steady_turning_ += (speed_.tail<3>() - steady_turning_) / kSteadyFrames;
    // All frames until then: one whose rows are placed as if the camera did not tremble is seldom sure.
    if ((counts || !is_trembling()) && is_measured_) learn_turn();
    if (!shutter_.is_estimated()) return;
    const SE3 camera_from_world = world_from_camera.inverse();
    shutter_.begin_frame();
    for (const std::uint16_t i : chosen) {
        const Correspondence& c = correspondences[i];
        const MapPoint& point = map.points().at(c.point_slot);
        shutter_.add(c, camera_from_world * c.p_world, camera_from_world.rotation * vector_of(point.world_by_readout),
                     static_cast<double>(frame.keypoint(c.feature).y), speed_, chi2_max);
    }
    pose_by_readout_previous_ = pose_by_readout_;
    pose_by_readout_ = shutter_.end_frame(counts && !has_turn_);
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
