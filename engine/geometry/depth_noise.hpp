// How uncertain a measured depth is (paper 2.1.3, method.md 1): the noise of structured-light cameras, and the 3x3
// mixture that makes features on an object's border uncertain.
#pragma once

#include "engine/frame/image_view.hpp"
#include "engine/geometry/camera_model.hpp"
#include "engine/geometry/eigen.hpp"

namespace stillmesh {

struct DepthNoise {
    double sigma_z_per_m2 = 1.425e-3;  // sigma_z = coefficient * z^2 (Khoshelham & Elberink 2012), 1/m
    double sigma_pixel = 1.0;          // px at pyramid level 0
    double z_min_m = 0.3;
    double z_max_m = 6.0;
    double sigma_max_m = 0.15;  // beyond: the feature has no usable depth (isolated, paper Fig. 4)
};

// Depth of one feature: mean and variance of the 3x3 mixture. variance_m2 < 0 means no valid depth there.
struct DepthSample {
    double mean_m = 0;
    double variance_m2 = -1;
    [[nodiscard]] bool is_valid() const noexcept { return variance_m2 >= 0; }
};

// The mixture over the 3x3 neighbourhood of pixel (x, y) (Dryanovski 2013). Invalid when none of the nine has depth,
// when (x, y) is outside, or mean > z_max, mean < z_min or sqrt(variance) > sigma_max.
[[nodiscard]] DepthSample sample_depth(const DepthView& depth, double metres_per_unit, std::int32_t x, std::int32_t y,
                                       const DepthNoise& noise) noexcept;

// 3D point in the camera frame from normalised coordinates and depth, m.
[[nodiscard]] inline Vector3 back_project(const Vector2& normalised, double z_m) noexcept {
    return {normalised.x() * z_m, normalised.y() * z_m, z_m};
}

}  // namespace stillmesh
