// How fast a body moves from one pose to the next.
#pragma once

#include <cmath>

#include "engine/geometry/rigid_transform.hpp"

namespace stillmesh {

struct Velocity {
    double linear_m_s[3] = {}, angular_rad_s[3] = {};
};
// In the frame of the body at the end of the step.
[[nodiscard]] inline Velocity velocity_between(const RigidTransform& from, const RigidTransform& to, double seconds) {
    const RigidTransform back = inverse_of(to);
    const std::array<double, 3> way =
        rotated(back, {to.translation_m[0] - from.translation_m[0], to.translation_m[1] - from.translation_m[1],
                       to.translation_m[2] - from.translation_m[2]});
    const RigidTransform step = compose(inverse_of(from), to);
    const double(&q)[4] = step.rotation_xyzw;
    const double sine = std::sqrt(q[0] * q[0] + q[1] * q[1] + q[2] * q[2]);
    const double angle_by_sine = sine > 1e-9 ? 2 * std::atan2(sine, std::abs(q[3])) / sine : 2;
    const double factor = (q[3] < 0 ? -angle_by_sine : angle_by_sine) / seconds;  // the shorter way round
    return {{way[0] / seconds, way[1] / seconds, way[2] / seconds}, {q[0] * factor, q[1] * factor, q[2] * factor}};
}

}  // namespace stillmesh
