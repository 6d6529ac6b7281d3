#include "platform/motion/simulated_accelerometer.hpp"

namespace stillmesh {

SimulatedAccelerometer::SimulatedAccelerometer(std::uint64_t seed) : random_(seed * 6700417 + 5) {
    Triple axis{};
    do {
        for (double& value : axis) value = random_.uniform(-1, 1);
    } while (length_of(axis) > 1 || length_of(axis) < 0.1);
    for (std::size_t i = 0; i < 3; ++i) bias_m_s2_[i] = kBias_m_s2 * axis[i] / length_of(axis);
}

bool SimulatedAccelerometer::step(const TrajectoryPose& truth) {
    const TrajectoryPose before = before_, at = last_;
    before_ = last_;
    last_ = truth;
    if (++frames_ < 3) return false;
    const double s0 = static_cast<double>(at.time_ns - before.time_ns) * 1e-9;
    const double s1 = static_cast<double>(truth.time_ns - at.time_ns) * 1e-9;
    Triple felt{0, 0, kGravity_m_s2};
    for (std::size_t i = 0; i < 3; ++i)
        felt[i] += ((truth.t[i] - at.t[i]) / s1 - (at.t[i] - before.t[i]) / s0) / (0.5 * (s0 + s1));
    reading_ = {at.time_ns, rotated(conjugate(at.q), felt)};
    for (std::size_t i = 0; i < 3; ++i) reading_.m_s2[i] += bias_m_s2_[i] + kNoise_m_s2 * random_.normal();
    return true;
}

}  // namespace stillmesh
