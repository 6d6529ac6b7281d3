// The camera in the map, of the two transforms that a pose consists of. Their arithmetic is beside RigidTransform.
#pragma once

#include "engine/geometry/rigid_transform.hpp"
#include "engine/outputs.hpp"

namespace stillmesh {

// What a trajectory is made of.
[[nodiscard]] inline RigidTransform map_from_camera(const PoseEstimate& pose) {
    return compose(pose.map_from_odom, pose.odom_from_camera);
}

}  // namespace stillmesh
