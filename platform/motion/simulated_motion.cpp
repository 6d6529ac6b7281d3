#include "platform/motion/simulated_motion.hpp"

#include <algorithm>

namespace stillmesh {

SimulatedMotion::SimulatedMotion(std::uint64_t seed, const MotionErrors& errors, double excess)
    : errors_(errors), excess_(excess), random_(seed * 7919 + 17) {
    sign_ = random_.uniform() < 0.5 ? -1 : 1;
    Triple axis{};
    do {
        for (double& value : axis) value = random_.uniform(-1, 1);
    } while (length_of(axis) > 1 || length_of(axis) < 0.1);
    for (std::size_t i = 0; i < 3; ++i) bias_rad_s_[i] = excess * errors.gyro_rad_s * axis[i] / length_of(axis);
}

bool SimulatedMotion::step(const TrajectoryPose& truth) {
    const TrajectoryPose last = last_;
    last_ = truth;
    if (!has_last_) {
        has_last_ = true;
        return false;
    }
    const double seconds = static_cast<double>(truth.time_ns - last.time_ns) * 1e-9;
    const RigidTransform step = step_between(last, truth);
    const double* const q = step.rotation_xyzw;
    const Triple turn = rotation_vector_of({q[0], q[1], q[2], q[3]});
    Triple turn_by_wheels{};
    Triple turn_by_gyroscope{};
    for (std::size_t i = 0; i < 3; ++i) {
        wheels_.last_from_camera.translation_m[i] = step.translation_m[i] * (1 + excess_ * sign_ * errors_.way_share) +
                                                    excess_ * errors_.step_m * random_.normal();
        turn_by_wheels[i] =
            turn[i] * (1 + excess_ * sign_ * errors_.turn_share) + excess_ * errors_.step_rad * random_.normal();
        rate_rad_s_[i] = turn[i] / seconds + bias_rad_s_[i] + excess_ * errors_.gyro_noise_rad_s * random_.normal();
        turn_by_gyroscope[i] = rate_rad_s_[i] * seconds;
    }
    const Quaternion by_wheels = quaternion_of(turn_by_wheels);
    const Quaternion by_gyroscope = quaternion_of(turn_by_gyroscope);
    std::copy(by_wheels.begin(), by_wheels.end(), wheels_.last_from_camera.rotation_xyzw);
    std::copy(by_gyroscope.begin(), by_gyroscope.end(), gyroscope_.last_from_camera.rotation_xyzw);
    const double* const t = step.translation_m;
    wheels_.sigma_m = errors_.way_share * length_of({t[0], t[1], t[2]}) + errors_.step_m;
    wheels_.sigma_rad = errors_.turn_share * length_of(turn) + errors_.step_rad;
    gyroscope_.sigma_m = -1;
    gyroscope_.sigma_rad = (errors_.gyro_rad_s + errors_.gyro_noise_rad_s) * seconds;
    return true;
}

}  // namespace stillmesh
