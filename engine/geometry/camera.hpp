// Pinhole projection and distortion (camera_model.hpp has the formulas). Features are undistorted once, when they
// enter; everything behind works on undistorted, normalised coordinates (x/z, y/z).
#pragma once

#include "engine/base/status.hpp"
#include "engine/geometry/camera_model.hpp"
#include "engine/geometry/eigen.hpp"

namespace stillmesh {

// kInvalid: a size of 0, a focal length that is not positive, a value that is not finite, a fisheye with other
// coefficients than its four, or a distortion that folds the image (not monotonic inside the image; a fisheye ends 84
// degrees off its axis).
[[nodiscard]] Status validate(const CameraModel& model) noexcept;

// Normalised (x/z, y/z) to raw (distorted) pixels.
[[nodiscard]] Vector2 distort_to_pixel(const CameraModel& model, const Vector2& normalised) noexcept;
// Where in the picture, or around it, a point `q` (m, camera frame) is seen: its raw pixel. False: it is nearer than
// `z_min_m`, or so far outside that no lens bends it in.
[[nodiscard]] bool project(const CameraModel& model, const Vector3& q, double z_min_m, Vector2& pixel) noexcept;
[[nodiscard]] inline bool is_in_picture(const CameraModel& model, const Vector2& pixel) noexcept {
    return pixel.x() >= 0 && pixel.y() >= 0 && pixel.x() < model.width && pixel.y() < model.height;
}
[[nodiscard]] inline bool visible_pixel(const CameraModel& model, const Vector3& q, double z_min_m,
                                        Vector2& pixel) noexcept {
    return project(model, q, z_min_m, pixel) && is_in_picture(model, pixel);
}
// Raw pixel to normalised, undistorted coordinates: a handful of Newton steps; residual below 0.01 px inside
// the image of any model that validate() accepts.
[[nodiscard]] Vector2 undistort_to_normalised(const CameraModel& model, const Vector2& pixel) noexcept;
// Cosine of the angle between the axis and the farthest corner of the picture.
[[nodiscard]] double view_cosine(const CameraModel& model) noexcept;

}  // namespace stillmesh
