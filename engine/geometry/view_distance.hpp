// How far apart two views are, for questions of which keyframes see the same: metres between the cameras, and a turn of
// the optical axis that counts as a distance.
#pragma once

#include "engine/geometry/se3.hpp"
#include "engine/geometry/turn_distance.hpp"

namespace stillmesh {

// Squared, in m^2, between two poses world_from_camera; turning about the optical axis counts for nothing.
[[nodiscard]] inline double view_distance_m2(const SE3& a, const SE3& b) noexcept {
    const Vector3 axis_a = a.rotation.col(2);
    const Vector3 axis_b = b.rotation.col(2);
    return (a.translation - b.translation).squaredNorm() + kTurn_m2 * (1.0 - axis_a.dot(axis_b));
}

}  // namespace stillmesh
