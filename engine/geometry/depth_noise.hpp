// How uncertain a measured 3D point is (paper 2.1.3, method.md 1): depth noise of structured-light and stereo cameras,
// the 3x3 mixture that makes features on an object's border uncertain, and the 3x3 covariance of the point.
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

// Covariance of that point, m^2 (method.md 1). `sigma_pixel_level` is sigma_pixel times the pyramid scale of the level.
[[nodiscard]] Matrix3 point_covariance(const CameraModel& model, const Vector2& normalised, const DepthSample& sample,
                                       double sigma_pixel_level) noexcept;

// Stereo (paper 2.1.3, method.md 1): field angles w1, w2 (horizontal, left and right), phi1, phi2 (vertical), their
// standard deviations in rad, baseline in m.
struct StereoNoise {
    double baseline_m = 0.12;
    double sigma_w1_rad = 5e-4, sigma_w2_rad = 5e-4, sigma_phi1_rad = 5e-4, sigma_phi2_rad = 5e-4;
};
struct StereoAngles {
    double w1_rad = 0, w2_rad = 0, phi1_rad = 0, phi2_rad = 0;
};
struct StereoPoint {
    Vector3 point = Vector3::Zero();
    Matrix3 covariance = Matrix3::Zero();
};
// kDegenerate-like input (tan w1 <= tan w2: a point at or beyond infinity) gives covariance with trace < 0.
[[nodiscard]] StereoPoint stereo_point(const StereoAngles& angles, const StereoNoise& noise) noexcept;

}  // namespace stillmesh
