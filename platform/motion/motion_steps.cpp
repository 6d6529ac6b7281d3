#include "platform/motion/motion_steps.hpp"

#include <algorithm>
#include <cmath>

namespace stillmesh {

double length_of(const Triple& v) {
    return std::sqrt(v[0] * v[0] + v[1] * v[1] + v[2] * v[2]);
}

Quaternion product(const Quaternion& a, const Quaternion& b) {
    return {
        a[3] * b[0] + a[0] * b[3] + a[1] * b[2] - a[2] * b[1], a[3] * b[1] - a[0] * b[2] + a[1] * b[3] + a[2] * b[0],
        a[3] * b[2] + a[0] * b[1] - a[1] * b[0] + a[2] * b[3], a[3] * b[3] - a[0] * b[0] - a[1] * b[1] - a[2] * b[2]};
}

Quaternion conjugate(const Quaternion& q) {
    return {-q[0], -q[1], -q[2], q[3]};
}

Triple rotated(const Quaternion& q, const Triple& v) {
    const Quaternion out = product(product(q, {v[0], v[1], v[2], 0}), conjugate(q));
    return {out[0], out[1], out[2]};
}

Quaternion quaternion_of(const Triple& rotation_vector_rad) {
    const double angle = length_of(rotation_vector_rad);
    const double s = angle < 1e-9 ? 0.5 : std::sin(angle / 2) / angle;
    return {s * rotation_vector_rad[0], s * rotation_vector_rad[1], s * rotation_vector_rad[2], std::cos(angle / 2)};
}

Triple rotation_vector_of(const Quaternion& q) {
    const double sign = q[3] < 0 ? -1 : 1;
    const double s = length_of({q[0], q[1], q[2]});
    const double factor = s < 1e-9 ? 2 * sign : 2 * sign * std::atan2(s, std::abs(q[3])) / s;
    return {factor * q[0], factor * q[1], factor * q[2]};
}

RigidTransform step_between(const TrajectoryPose& from, const TrajectoryPose& to) {
    RigidTransform out;
    const Quaternion back = conjugate(from.q);
    const Quaternion q = product(back, to.q);
    const Triple t = rotated(back, {to.t[0] - from.t[0], to.t[1] - from.t[1], to.t[2] - from.t[2]});
    std::copy(q.begin(), q.end(), out.rotation_xyzw);
    std::copy(t.begin(), t.end(), out.translation_m);
    return out;
}

TrajectoryPose moved_by(const TrajectoryPose& pose, const RigidTransform& step, std::int64_t time_ns) {
    TrajectoryPose out;
    out.time_ns = time_ns;
    const double* const r = step.rotation_xyzw;
    const double* const s = step.translation_m;
    out.q = product(pose.q, {r[0], r[1], r[2], r[3]});
    const double norm =
        std::sqrt(out.q[0] * out.q[0] + out.q[1] * out.q[1] + out.q[2] * out.q[2] + out.q[3] * out.q[3]);
    for (double& value : out.q) value /= norm;
    const Triple t = rotated(pose.q, {s[0], s[1], s[2]});
    for (std::size_t i = 0; i < 3; ++i) out.t[i] = pose.t[i] + t[i];
    return out;
}

TrajectoryPose between(const TrajectoryPose& from, const TrajectoryPose& to, double share) {
    TrajectoryPose out;
    out.time_ns = from.time_ns + static_cast<std::int64_t>(share * static_cast<double>(to.time_ns - from.time_ns));
    Triple turn = rotation_vector_of(product(conjugate(from.q), to.q));
    for (double& value : turn) value *= share;
    out.q = product(from.q, quaternion_of(turn));
    for (std::size_t i = 0; i < 3; ++i) out.t[i] = from.t[i] + share * (to.t[i] - from.t[i]);
    return out;
}

}  // namespace stillmesh
