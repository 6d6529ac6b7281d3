// Where the camera was, and where it should be next: constant velocity in the camera's frame. Hands and wheels
// accelerate, so the prediction says how unsure it is; what was not measured fades, and so does what a choice that was
// not sure says of sliding. Cost: one logarithm and one exponential a frame.
#pragma once

#include <cstdint>

#include "engine/geometry/se3.hpp"
#include "engine/parameters.hpp"

namespace stillmesh {

class MotionModel {
public:
    struct Prediction {
        SE3 world_from_camera;
        double sigma_m = 0;
        double sigma_rad = 0;
        double rotation_speed_rad_s = 0;  // of the last two frames
    };

    void reset() noexcept { *this = MotionModel{}; }
    // In a new map, at rest.
    void begin_at(const SE3& world_from_camera) noexcept;
    // In a map that was made until `time_ns`: nothing is known of the motion.
    void begin_after(std::int64_t time_ns) noexcept;

    // Poses of the last frame and of the one before.
    [[nodiscard]] const SE3& world_from_camera() const noexcept { return world_from_camera_; }
    [[nodiscard]] const SE3& world_from_camera_previous() const noexcept { return world_from_camera_previous_; }
    // False: the last two poses do not tell how fast the camera is.
    [[nodiscard]] bool has_velocity() const noexcept { return has_velocity_; }
    [[nodiscard]] std::int64_t time_ns() const noexcept { return time_ns_; }  // of the last frame

    [[nodiscard]] Prediction predict(std::int64_t time_ns, const PredictionParameters& parameters,
                                     std::uint32_t lost_frames, bool is_choice_sure) const noexcept;

    // The frame's pose; its time follows when the frame is done.
    void move_to(const SE3& world_from_camera) noexcept;
    void set_has_velocity(bool has_velocity) noexcept { has_velocity_ = has_velocity; }
    void end_frame(std::int64_t time_ns) noexcept;

    // The world under the camera moved by `correction` (on the left of world coordinates).
    void follow(const SE3& correction) noexcept;
    // What the camera was thought to be, in its own frame: increments of the last two poses.
    void amend(const SE3& change, const SE3& change_previous) noexcept;

private:
    SE3 world_from_camera_;
    SE3 world_from_camera_previous_;
    std::int64_t time_ns_ = 0;
    std::int64_t previous_time_ns_ = 0;
    bool has_velocity_ = false;
};

}  // namespace stillmesh
