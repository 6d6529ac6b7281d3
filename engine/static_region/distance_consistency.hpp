// Algorithm 1 with the covariance test (method.md 4): did the 3D length of an edge change by more than its noise?
#pragma once

#include <cmath>

#include "engine/matching/correspondence.hpp"

namespace stillmesh {

// Variance of a point along the unit direction e, m^2: var_z (e . r)^2 + lateral (e_x^2 + e_y^2), with r the ray
// (x/z, y/z, 1).
[[nodiscard]] inline double variance_along(const Vector3& e, const Vector2& ray, double var_z,
                                           double var_lateral) noexcept {
    const double along = e.x() * ray.x() + e.y() * ray.y() + e.z();
    return var_z * along * along + var_lateral * (e.x() * e.x() + e.y() * e.y());
}

struct EdgeTest {
    double change_max_m = 0.1;  // tau
    double chi2_max = 6.63;
    double floor_m = 0.005;    // error that nobody models
    double lag_angle_rad = 0;  // what rotation between colour and depth turns the rays by
    Matrix3 camera_from_world_rotation = Matrix3::Identity();  // predicted
};

// Keep iff |l - l'| <= tau and (l - l')^2 <= chi2_max (var_l + var_l'). Both ends have depth.
[[nodiscard]] inline bool keeps_distance(const Correspondence& a, const Correspondence& b,
                                         const EdgeTest& test) noexcept {
    const Vector3 now = a.p_camera - b.p_camera;
    Vector3 then;
    then.noalias() = test.camera_from_world_rotation * (a.p_world - b.p_world);
    const double l = std::sqrt(now.squaredNorm());
    const double l_then = std::sqrt(then.squaredNorm());
    const double change = l - l_then;
    if (!(change <= test.change_max_m && change >= -test.change_max_m)) return false;
    const double za2 = a.p_camera.z() * a.p_camera.z();
    const double zb2 = b.p_camera.z() * b.p_camera.z();
    const double lateral_a = a.var_pixel * za2;
    const double lateral_b = b.var_pixel * zb2;
    double variance = test.floor_m * test.floor_m + test.lag_angle_rad * test.lag_angle_rad * 0.5 * (za2 + zb2);
    constexpr double kShort_m = 0.01;  // shorter: the direction is noise, the isotropic third of the trace serves
    if (l < kShort_m || l_then < kShort_m) {
        variance += (a.var_z + a.map_var_z + b.var_z + b.map_var_z) / 3.0 +
                    (lateral_a + lateral_b + a.map_var_lateral + b.map_var_lateral) * (2.0 / 3.0);
    } else {
        const Vector3 e = now / l;
        const Vector3 e_then = then / l_then;
        variance += variance_along(e, a.normalised, a.var_z, lateral_a) +
                    variance_along(e, b.normalised, b.var_z, lateral_b) +
                    variance_along(e_then, a.normalised, a.map_var_z, a.map_var_lateral) +
                    variance_along(e_then, b.normalised, b.map_var_z, b.map_var_lateral);
    }
    return change * change <= test.chi2_max * variance;
}

}  // namespace stillmesh
