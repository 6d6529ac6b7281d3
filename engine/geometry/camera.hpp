// Pinhole projection and distortion. Features are undistorted once, when they enter; everything behind works on
// undistorted, normalised coordinates (x/z, y/z).
#pragma once

#include "engine/base/status.hpp"
#include "engine/geometry/camera_model.hpp"
#include "engine/geometry/eigen.hpp"

namespace stillmesh {

// kInvalid: a size of 0, a focal length that is not positive, a value that is not finite, or a distortion that folds
// the image (not monotonic inside the image).
[[nodiscard]] Status validate(const CameraModel& model) noexcept;

// Normalised (x/z, y/z) to raw (distorted) pixels.
[[nodiscard]] Vector2 distort_to_pixel(const CameraModel& model, const Vector2& normalised) noexcept;
// Raw pixel to normalised, undistorted coordinates: a handful of Newton steps; residual below 0.01 px inside
// the image of any model that validate() accepts.
[[nodiscard]] Vector2 undistort_to_normalised(const CameraModel& model, const Vector2& pixel) noexcept;
// Cosine of the angle between the axis and the farthest corner of the picture.
[[nodiscard]] double view_cosine(const CameraModel& model) noexcept;

}  // namespace stillmesh
