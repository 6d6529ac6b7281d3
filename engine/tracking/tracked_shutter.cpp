#include "engine/tracking/tracked_shutter.hpp"

namespace stillmesh {

void TrackedShutter::reset() noexcept {
    shutter_.reset();
    speed_ = Vector6::Zero();
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
}

void TrackedShutter::learn(const MeasuredFrame& frame, const Map& map, std::span<const Correspondence> correspondences,
                           std::span<const std::uint16_t> chosen, const SE3& world_from_camera, double chi2_max,
                           bool counts) noexcept {
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
