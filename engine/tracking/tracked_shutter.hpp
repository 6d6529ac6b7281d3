// The rolling shutter (engine/pose/rolling_shutter.hpp) in the hands of tracking: with which speed the frame's rows are
// carried, how the frame's pose and what it measures move with the readout, and what becomes of the map and of the
// camera when the readout believed changes. Cost: one pass over the static matches a frame; one over the map when a new
// readout is adopted.
#pragma once

#include <cstdint>
#include <span>

#include "engine/map/map.hpp"
#include "engine/matching/correspondence.hpp"
#include "engine/parameters.hpp"
#include "engine/pose/rolling_shutter.hpp"
#include "engine/tracking/measured_frame.hpp"
#include "engine/tracking/motion_model.hpp"

namespace stillmesh {

class TrackedShutter {
public:
    void create(const Parameters& configuration, std::uint32_t image_height) noexcept {
        shutter_.create(configuration.camera.readout_s, image_height, configuration.shutter);
    }
    void reset() noexcept;
    // Goes on with the readout of a map from before, or expresses the map with the one that is given.
    void begin_in(Map& map) noexcept;

    [[nodiscard]] const RollingShutter& shutter() const noexcept { return shutter_; }
    [[nodiscard]] double readout_s() const noexcept { return shutter_.readout_s(); }
    // Of the camera in this frame, per second, in its own frame.
    [[nodiscard]] const Vector6& speed() const noexcept { return speed_; }
    // How the pose of the last frame learnt from moves with the readout, per second, in the camera.
    [[nodiscard]] const Vector6& pose_by_readout() const noexcept { return pose_by_readout_; }
    // How a point that this frame measures at p (in the camera) in row y_px moves with the readout, in the world, m/s.
    [[nodiscard]] Vector3 by_readout(const SE3& world_from_camera, const Vector3& p, float y_px) const noexcept;

    // The camera moved by `camera_motion` in `duration_s`.
    void set_motion(const SE3& camera_motion, double duration_s) noexcept;
    // What the static matches say of the readout; it is learnt from where `counts`.
    void learn(const MeasuredFrame& frame, const Map& map, std::span<const Correspondence> correspondences,
               std::span<const std::uint16_t> chosen, const SE3& world_from_camera, double chi2_max,
               bool counts) noexcept;
    // How fast the camera was in the first frame shows in the second: the map's only keyframe, of `start_time_ns`, and
    // its points learn it now.
    void backdate(Map& map, std::int64_t start_time_ns) const noexcept;
    // The map, and where the camera was, as they would be had the readout been known all along.
    void adopt(Map& map, MotionModel& motion) noexcept;

private:
    RollingShutter shutter_;
    Vector6 speed_ = Vector6::Zero();
    Vector6 pose_by_readout_ = Vector6::Zero();
    Vector6 pose_by_readout_previous_ = Vector6::Zero();  // of the frame before
};

}  // namespace stillmesh
