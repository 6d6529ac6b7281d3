// Soft shadows of people under the four lamps of the ceiling: someone is an upright post, and a point is dark as far as
// the way to a lamp passes through it.
#pragma once

#include <span>

#include "hal/simulated/vector3.hpp"

namespace stillmesh::simulated {

struct Post {
    Vec3 foot;  // on the floor
    double height = 1.75;
};

// Factor on the light of a point of the room, 1 where no shadow falls.
[[nodiscard]] double light_left(std::span<const Post> posts, const Vec3& point, double strength) noexcept;

}  // namespace stillmesh::simulated
