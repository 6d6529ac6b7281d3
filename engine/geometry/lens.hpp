// The lens for programs: between pixels and rays, as the engine itself bends them, without Eigen. Cost: a
// handful of Newton steps from a pixel, one polynomial from a ray.
#pragma once

#include "engine/base/api.hpp"
#include "engine/geometry/camera_model.hpp"

namespace stillmesh {

// Normalised coordinates x/z and y/z, undistorted; or a raw pixel.
struct ImagePoint {
    double x = 0, y = 0;
};

// Residual below 0.01 px inside the image of any model that the engine accepts.
[[nodiscard]] STILLMESH_API ImagePoint ray_of_pixel(const CameraModel& model, ImagePoint pixel) noexcept;
[[nodiscard]] STILLMESH_API ImagePoint pixel_of_ray(const CameraModel& model, ImagePoint ray) noexcept;

}  // namespace stillmesh
