// Rigid transforms as the engine gives them: put together, inverted, applied. Plain arithmetic, no library; a unit
// quaternion stays one to 1e-15 a product, and is not normalised again.
#pragma once

#include <array>

#include "engine/outputs.hpp"

namespace stillmesh {

// a_from_b applied to a point of b.
[[nodiscard]] inline std::array<double, 3> transformed(const RigidTransform& a_from_b, const std::array<double, 3>& p) {
    const double(&q)[4] = a_from_b.rotation_xyzw;
    const double(&t)[3] = a_from_b.translation_m;
    // p + 2 w (u x p) + 2 u x (u x p) + t
    const double c[3] = {q[1] * p[2] - q[2] * p[1], q[2] * p[0] - q[0] * p[2], q[0] * p[1] - q[1] * p[0]};
    const double d[3] = {q[1] * c[2] - q[2] * c[1], q[2] * c[0] - q[0] * c[2], q[0] * c[1] - q[1] * c[0]};
    return {p[0] + 2 * (q[3] * c[0] + d[0]) + t[0], p[1] + 2 * (q[3] * c[1] + d[1]) + t[1],
            p[2] + 2 * (q[3] * c[2] + d[2]) + t[2]};
}

// a_from_b * b_from_c = a_from_c.
[[nodiscard]] inline RigidTransform compose(const RigidTransform& a_from_b, const RigidTransform& b_from_c) {
    const double(&a)[4] = a_from_b.rotation_xyzw;
    const double(&b)[4] = b_from_c.rotation_xyzw;
    const double(&t)[3] = b_from_c.translation_m;
    const std::array<double, 3> moved = transformed(a_from_b, {t[0], t[1], t[2]});
    return {
        {a[3] * b[0] + a[0] * b[3] + a[1] * b[2] - a[2] * b[1], a[3] * b[1] + a[1] * b[3] + a[2] * b[0] - a[0] * b[2],
         a[3] * b[2] + a[2] * b[3] + a[0] * b[1] - a[1] * b[0], a[3] * b[3] - a[0] * b[0] - a[1] * b[1] - a[2] * b[2]},
        {moved[0], moved[1], moved[2]}};
}

[[nodiscard]] inline RigidTransform inverse_of(const RigidTransform& a_from_b) {
    const double(&q)[4] = a_from_b.rotation_xyzw;
    const double(&t)[3] = a_from_b.translation_m;
    const RigidTransform turned{{-q[0], -q[1], -q[2], q[3]}, {0, 0, 0}};
    const std::array<double, 3> moved = transformed(turned, {t[0], t[1], t[2]});
    return {{-q[0], -q[1], -q[2], q[3]}, {-moved[0], -moved[1], -moved[2]}};
}

// The camera in the map: what a trajectory is made of.
[[nodiscard]] inline RigidTransform map_from_camera(const PoseEstimate& pose) {
    return compose(pose.map_from_odom, pose.odom_from_camera);
}

}  // namespace stillmesh
