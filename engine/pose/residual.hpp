// How badly a pose explains a correspondence: reprojection and depth residuals, each divided by its deviation
// (method.md 1 and 6). The map point's own uncertainty counts as seen from the camera.
#pragma once

#include "engine/matching/correspondence.hpp"

namespace stillmesh {

inline constexpr double kDepthMin_m = 0.05;
inline constexpr double kChi2Behind = 1e12;  // of a point behind the camera

struct Residual {
    double x = 0, y = 0, z = 0;                 // normalised coordinates (2) and depth, m
    double info_x = 0, info_y = 0, info_z = 0;  // inverse variances; info_z = 0 without depth
    [[nodiscard]] double chi2() const noexcept { return x * x * info_x + y * y * info_y + z * z * info_z; }
};

// `q` is the point in the camera frame (q.z > kDepthMin_m).
[[nodiscard]] inline Residual residual_of(const Correspondence& c, const Vector3& q, double map_var_lateral,
                                          double map_var_z) noexcept {
    Residual r;
    const double inverse_z = 1.0 / q.z();
    r.x = q.x() * inverse_z - c.normalised.x();
    r.y = q.y() * inverse_z - c.normalised.y();
    r.info_x = 1.0 / (c.var_pixel + map_var_lateral * inverse_z * inverse_z);
    r.info_y = r.info_x;
    if (c.has_depth) {
        r.z = q.z() - c.p_camera.z();
        r.info_z = 1.0 / (c.var_z + map_var_z);
    }
    return r;
}

// Squared Mahalanobis residual against a place in the world that is known so well.
[[nodiscard]] inline double chi2_against(const Vector3& p_world, double var_lateral, double var_z,
                                         const Correspondence& c, const SE3& camera_from_world) noexcept {
    const Vector3 q = camera_from_world * p_world;
    if (q.z() < kDepthMin_m) return kChi2Behind;
    return residual_of(c, q, var_lateral, var_z).chi2();
}

// Against the map's estimate of the point.
[[nodiscard]] inline double chi2_of(const Correspondence& c, const SE3& camera_from_world) noexcept {
    return chi2_against(c.p_world, c.map_var_lateral, c.map_var_z, c, camera_from_world);
}

// The same, odometry having drifted while the point was out of sight: whether it may stand still, not what it says.
[[nodiscard]] inline double chi2_with_drift(const Correspondence& c, const SE3& camera_from_world) noexcept {
    return chi2_against(c.p_world, c.map_var_lateral + c.drift_var, c.map_var_z + c.drift_var, c, camera_from_world);
}

// Against where the point was first seen: the long time base (method.md 11.2).
[[nodiscard]] inline double chi2_of_anchor(const Correspondence& c, const SE3& camera_from_world) noexcept {
    return chi2_against(c.p_anchor, c.anchor_var_lateral, c.anchor_var_z, c, camera_from_world);
}

}  // namespace stillmesh
