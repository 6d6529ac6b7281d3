// Rotations and motions as files have them: unit quaternions x y z w, metres.
#pragma once

#include <array>
#include <cstdint>

#include "engine/outputs.hpp"
#include "platform/evaluation/trajectory.hpp"

namespace stillmesh {

using Quaternion = std::array<double, 4>;  // x y z w
using Triple = std::array<double, 3>;

[[nodiscard]] double length_of(const Triple& v);
[[nodiscard]] Quaternion product(const Quaternion& a, const Quaternion& b);
[[nodiscard]] Quaternion conjugate(const Quaternion& q);
[[nodiscard]] Triple rotated(const Quaternion& q, const Triple& v);
// By the angle that is its length, about the axis it points along.
[[nodiscard]] Quaternion quaternion_of(const Triple& rotation_vector_rad);
[[nodiscard]] Triple rotation_vector_of(const Quaternion& q);

// From one pose to another: the later camera seen from the earlier one.
[[nodiscard]] RigidTransform step_between(const TrajectoryPose& from, const TrajectoryPose& to);
// A pose a step later.
[[nodiscard]] TrajectoryPose moved_by(const TrajectoryPose& pose, const RigidTransform& step, std::int64_t time_ns);
// The share of the way and of the turn from one pose to another.
[[nodiscard]] TrajectoryPose between(const TrajectoryPose& from, const TrajectoryPose& to, double share);

}  // namespace stillmesh
