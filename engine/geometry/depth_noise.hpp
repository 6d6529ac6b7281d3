// How uncertain a measured depth is (paper 2.1.3, method.md 1): the noise of structured-light cameras, and the 3x3
// mixture that makes features on an object's border uncertain.
#pragma once

#include "engine/configuration.hpp"
#include "engine/frame/image_view.hpp"
#include "engine/geometry/eigen.hpp"

namespace stillmesh {

// Depth of one feature: mean and variance of the 3x3 mixture. variance_m2 < 0 means no valid depth there.
struct DepthSample {
    double mean_m = 0;
    double variance_m2 = -1;
    [[nodiscard]] bool is_valid() const noexcept { return variance_m2 >= 0; }
};

// sigma_z = sigma_z_per_m2 * z^2 (Khoshelham & Elberink 2012). Beyond sigma_max_m the feature has no usable depth
// (isolated, paper Fig. 4).
//
// The mixture over the 3x3 neighbourhood of pixel (x, y) (Dryanovski 2013). Invalid when none of the nine has depth,
// when (x, y) is outside, or mean > z_max, mean < z_min or sqrt(variance) > sigma_max.
[[nodiscard]] DepthSample sample_depth(const DepthView& depth, double metres_per_unit, std::int32_t x, std::int32_t y,
                                       const DepthParameters& noise) noexcept;

// 3D point in the camera frame from normalised coordinates and depth, m.
[[nodiscard]] inline Vector3 back_project(const Vector2& normalised, double z_m) noexcept {
    return {normalised.x() * z_m, normalised.y() * z_m, z_m};
}

}  // namespace stillmesh
