// A pose as programs see it.
#pragma once

#include "engine/geometry/se3.hpp"
#include "engine/outputs.hpp"

namespace stillmesh {

[[nodiscard]] inline RigidTransform transform_of(const SE3& pose) noexcept {
    RigidTransform out;
    const Vector4 q = quaternion_from_rotation(pose.rotation);
    for (int i = 0; i < 4; ++i) out.rotation_xyzw[i] = q(i);
    for (int i = 0; i < 3; ++i) out.translation_m[i] = pose.translation(i);
    return out;
}

}  // namespace stillmesh
