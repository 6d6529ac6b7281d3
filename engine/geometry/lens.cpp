#include "engine/geometry/lens.hpp"

#include "engine/geometry/camera.hpp"

namespace stillmesh {

ImagePoint ray_of_pixel(const CameraModel& model, ImagePoint pixel) noexcept {
    const Vector2 ray = undistort_to_normalised(model, Vector2(pixel.x, pixel.y));
    return {ray.x(), ray.y()};
}

ImagePoint pixel_of_ray(const CameraModel& model, ImagePoint ray) noexcept {
    const Vector2 pixel = distort_to_pixel(model, Vector2(ray.x, ray.y));
    return {pixel.x(), pixel.y()};
}

}  // namespace stillmesh
