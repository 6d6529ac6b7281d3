// Wheels and a gyroscope that a simulated camera would have: its true motion from frame to frame with the errors of
// such instruments, made from a seed.
#pragma once

#include <cstdint>

#include "engine/base/random.hpp"
#include "engine/motion_hint.hpp"
#include "platform/motion/motion_errors.hpp"
#include "platform/motion/motion_steps.hpp"

namespace stillmesh {

class SimulatedMotion {
public:
    // `excess`: the errors are so many times what is claimed.
    SimulatedMotion(std::uint64_t seed, const MotionErrors& errors = {}, double excess = 1);

    // From the pose of the call before to this one. False: there was none.
    [[nodiscard]] bool step(const TrajectoryPose& truth);
    // Of the last step.
    [[nodiscard]] MotionHint wheels() const { return wheels_; }
    [[nodiscard]] MotionHint gyroscope() const { return gyroscope_; }
    [[nodiscard]] Triple gyroscope_rad_s() const { return rate_rad_s_; }

private:
    MotionErrors errors_;
    double excess_;
    Random random_;
    double sign_ = 1;
    Triple bias_rad_s_{};
    bool has_last_ = false;
    TrajectoryPose last_;
    MotionHint wheels_, gyroscope_;
    Triple rate_rad_s_{};
};

}  // namespace stillmesh
