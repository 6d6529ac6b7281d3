// A robot's body from frame to frame, and how far what is said of it can be trusted: for messages to whoever drives.
// Memory: one frame's report. No heap.
#pragma once

#include <cstdint>

#include "platform/poses/body_frames.hpp"
#include "platform/poses/pose_line.hpp"

namespace stillmesh {

// All in the body's axes.
struct BodyStep {
    Covariance6 covariance{};  // of the pose, with the doubt of its state
    // The frame before has a pose in the same map: what follows is known.
    bool is_next = false;
    Velocity velocity;
    // The difference of two poses, each as uncertain as it is; more than it is where both are off by the same.
    Covariance6 velocity_covariance{};
};

class BodyCourse {
public:
    explicit BodyCourse(const BodyFrames& frames) : frames_(frames) {}
    // The next frame. One without a pose has no step, and none leads on from it.
    [[nodiscard]] const BodyStep& follow(const PoseReport& report);

private:
    BodyFrames frames_;
    PoseReport last_;
    bool has_last_ = false;
    Covariance6 measured_{};  // by the last frame that was
    std::int64_t measured_ns_ = 0;
    BodyStep step_;
};

}  // namespace stillmesh
