// The accelerometer that a simulated camera would have: its true acceleration at each frame, and gravity, with a bias
// and noise made from a seed. The acceleration at a frame is known once the next one is.
#pragma once

#include <cstdint>

#include "engine/base/random.hpp"
#include "platform/motion/gravity_finder.hpp"

namespace stillmesh {

class SimulatedAccelerometer {
public:
    static constexpr double kBias_m_s2 = 0.05, kNoise_m_s2 = 0.02;

    // The world's z axis is up.
    explicit SimulatedAccelerometer(std::uint64_t seed);

    // The next frame's true pose. False: there are not three yet.
    [[nodiscard]] bool step(const TrajectoryPose& truth);
    // At the frame before the last one.
    [[nodiscard]] const Acceleration& reading() const { return reading_; }

private:
    Random random_;
    Triple bias_m_s2_{};
    int frames_ = 0;
    TrajectoryPose before_, last_;
    Acceleration reading_;
};

}  // namespace stillmesh
