// Where the camera can have got since it was last sure: on at the speed it had then, and aside by what hands and wheels
// accelerate, or as far as a lost camera gets in the time. A pose that nothing else speaks for and that lies beyond
// follows a body that moves. Held against the last sure pose, not against the frame before, so that unsure poses do
// not lead each other astray step by step, and a camera that was misled may come back. Cost: one exponential.
#pragma once

#include <cstdint>

#include "engine/geometry/se3.hpp"
#include "engine/parameters.hpp"
#include "engine/tracking/motion_model.hpp"

namespace stillmesh {

class CameraReach {
public:
    // The camera is at `world_from_camera` for sure; how fast it is is not known.
    void begin(const SE3& world_from_camera, std::int64_t time_ns) noexcept;
    // The pose that `motion` was just moved to is sure; its time, which `motion` learns when the frame is done.
    void note(const MotionModel& motion, bool has_velocity, std::int64_t time_ns) noexcept;
    // The world under the camera moved by `correction` (on the left of world coordinates).
    void follow(const SE3& correction) noexcept;

    [[nodiscard]] bool holds(const SE3& world_from_camera, std::int64_t time_ns,
                             const Parameters& configuration) const noexcept;

private:
    SE3 world_from_camera_;
    Vector6 velocity_ = Vector6::Zero();  // per second, in the camera's frame
    std::int64_t time_ns_ = 0;
};

}  // namespace stillmesh
