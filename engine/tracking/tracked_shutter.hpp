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
#include "engine/pose/row_turn.hpp"
#include "engine/tracking/measured_frame.hpp"
#include "engine/tracking/motion_model.hpp"

namespace stillmesh {

class TrackedShutter {
public:
    void create(const Parameters& configuration, std::uint32_t image_height) noexcept {
        shutter_.create(configuration.camera.readout_s, image_height, configuration.shutter);
        parameters_ = configuration.shutter;
        reset();
    }
    void reset() noexcept;
    // Goes on with the readout of a map from before, or expresses the map with the one that is given.
    void begin_in(Map& map) noexcept;

    [[nodiscard]] const RollingShutter& shutter() const noexcept { return shutter_; }
    [[nodiscard]] double readout_s() const noexcept { return shutter_.readout_s(); }
    // Of the camera in this frame, by its motion from frame to frame, per second, in its own frame.
    [[nodiscard]] const Vector6& speed() const noexcept { return speed_; }
    // From this frame's first row to its last, the turn as the rows show it.
    [[nodiscard]] const Vector6& sweep() const noexcept { return sweep_; }
    // How the pose of the last frame learnt from moves with the readout, per second, in the camera.
    [[nodiscard]] const Vector6& pose_by_readout() const noexcept { return pose_by_readout_; }
    // How a point that this frame measures at p (in the camera) in row y_px moves with the readout, in the world, m/s.
    [[nodiscard]] Vector3 by_readout(const SE3& world_from_camera, const Vector3& p, float y_px) const noexcept;

    // A new frame: nothing is known of its turn.
    void begin_frame() noexcept { has_turn_ = is_measured_ = false; }
    // The camera moved by `camera_motion` in `duration_s`; a turn that was measured stays.
    void set_motion(const SE3& camera_motion, double duration_s) noexcept;
    [[nodiscard]] bool is_trembling() const noexcept { return trembling_.is_found(); }
    // The turn during the frame, by what its rows show beside what the motion makes expect (engine/pose/row_turn.hpp).
    // The correspondences' rows are carried with sweep(). True: that changed, since the camera trembles.
    [[nodiscard]] bool measure_turn(std::span<const Correspondence> correspondences,
                                    std::span<const std::uint16_t> chosen, const SE3& world_from_camera,
                                    double chi2_max) noexcept;
    // What the static matches say of the readout, which is learnt from where `counts`, and of a trembling.
    void learn(const MeasuredFrame& frame, const Map& map, std::span<const Correspondence> correspondences,
               std::span<const std::uint16_t> chosen, const SE3& world_from_camera, double chi2_max,
               bool counts) noexcept;
    // How fast the camera was in the first frame shows in the second: the map's only keyframe, of `start_time_ns`, and
    // its points learn it now.
    void backdate(Map& map, std::int64_t start_time_ns) const noexcept;
    // The map, and where the camera was, as they would be had the readout been known all along.
    void adopt(Map& map, MotionModel& motion) noexcept;

private:
    void learn_turn() noexcept;
    [[nodiscard]] Vector3 expected_turn() const noexcept { return speed_.tail<3>() * shutter_.readout_s(); }

    RollingShutter shutter_;
    ShutterParameters parameters_;
    Vector6 speed_ = Vector6::Zero();
    Vector6 sweep_ = Vector6::Zero();
    Vector3 steady_turning_ = Vector3::Zero();  // rad/s, without the trembling
    Trembling trembling_;
    Vector3 turn_ = Vector3::Zero();
    Vector3 off_ = Vector3::Zero();  // of the turn from the one expected
    double off_variance_ = 0;
    bool is_measured_ = false;  // by this frame's rows
    bool has_turn_ = false;     // that rows are carried with
    Vector6 pose_by_readout_ = Vector6::Zero();
    Vector6 pose_by_readout_previous_ = Vector6::Zero();  // of the frame before
};

}  // namespace stillmesh
