// Rigid motions as programs outside the engine need them: products, inverses and the velocity between two poses. Plain
// functions of doubles; no heap.
#pragma once

#include <cmath>

#include "engine/geometry/rigid_transform.hpp"

namespace stillmesh {

struct UnitQuaternion {
    double x = 0, y = 0, z = 0, w = 1;
};
[[nodiscard]] inline UnitQuaternion operator*(const UnitQuaternion& a, const UnitQuaternion& b) {
    return {a.w * b.x + a.x * b.w + a.y * b.z - a.z * b.y, a.w * b.y - a.x * b.z + a.y * b.w + a.z * b.x,
            a.w * b.z + a.x * b.y - a.y * b.x + a.z * b.w, a.w * b.w - a.x * b.x - a.y * b.y - a.z * b.z};
}
[[nodiscard]] inline UnitQuaternion conjugate(const UnitQuaternion& q) {
    return {-q.x, -q.y, -q.z, q.w};
}
[[nodiscard]] inline UnitQuaternion rotation_of(const RigidTransform& pose) {
    const auto [x, y, z, w] = pose.rotation_xyzw;
    return {x, y, z, w};
}
// The vector in x, y and z.
[[nodiscard]] inline UnitQuaternion rotated(const UnitQuaternion& q, double x, double y, double z) {
    return q * UnitQuaternion{x, y, z, 0} * conjugate(q);
}

[[nodiscard]] inline RigidTransform product(const RigidTransform& a, const RigidTransform& b) {
    const UnitQuaternion q = rotation_of(a) * rotation_of(b);
    const UnitQuaternion t = rotated(rotation_of(a), b.translation_m[0], b.translation_m[1], b.translation_m[2]);
    return {{q.x, q.y, q.z, q.w}, {t.x + a.translation_m[0], t.y + a.translation_m[1], t.z + a.translation_m[2]}};
}

[[nodiscard]] inline RigidTransform inverse(const RigidTransform& a) {
    const UnitQuaternion q = conjugate(rotation_of(a));
    const UnitQuaternion t = rotated(q, a.translation_m[0], a.translation_m[1], a.translation_m[2]);
    return {{q.x, q.y, q.z, q.w}, {-t.x, -t.y, -t.z}};
}

struct Velocity {
    double linear_m_s[3] = {}, angular_rad_s[3] = {};
};
// In the frame of the body at the end of the step.
[[nodiscard]] inline Velocity velocity_between(const RigidTransform& from, const RigidTransform& to, double seconds) {
    const UnitQuaternion back = conjugate(rotation_of(to));
    const UnitQuaternion way =
        rotated(back, to.translation_m[0] - from.translation_m[0], to.translation_m[1] - from.translation_m[1],
                to.translation_m[2] - from.translation_m[2]);
    UnitQuaternion turn = conjugate(rotation_of(from)) * rotation_of(to);
    if (turn.w < 0) turn = {-turn.x, -turn.y, -turn.z, -turn.w};
    const double sine = std::sqrt(turn.x * turn.x + turn.y * turn.y + turn.z * turn.z);
    const double angle_by_sine = sine > 1e-9 ? 2 * std::atan2(sine, turn.w) / sine : 2;
    const double factor = angle_by_sine / seconds;
    return {{way.x / seconds, way.y / seconds, way.z / seconds}, {turn.x * factor, turn.y * factor, turn.z * factor}};
}

}  // namespace stillmesh
