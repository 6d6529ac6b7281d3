// One observation of a map point by a keyframe, linearised: reprojection (normalised image coordinates) and depth
// residuals, their weights, and their derivatives by the pose (right increment T * exp(xi), xi = [translation,
// rotation]) and by the point. The same residuals as in pose/residual.hpp with an exact map (method.md 1 and 6).
// Everything here is inline, plain loops over small arrays: it is the innermost loop of the adjustment.
#pragma once

#include <cmath>

#include "engine/geometry/se3.hpp"

namespace stillmesh {

// camera_from_world as rows: what projecting a point needs, one after the other in memory.
struct CameraRows {
    double r[9] = {1, 0, 0, 0, 1, 0, 0, 0, 1};
    double t[3] = {};
};

[[nodiscard]] inline CameraRows camera_rows(const SE3& world_from_camera) noexcept {
    const SE3 inverse = world_from_camera.inverse();
    CameraRows rows;
    for (int i = 0; i < 3; ++i) {
        for (int j = 0; j < 3; ++j) rows.r[3 * i + j] = inverse.rotation(i, j);
        rows.t[i] = inverse.translation(i);
    }
    return rows;
}

// What a keyframe saw: normalised coordinates, depth, inverse variances (info_z = 0: no depth).
struct Sighting {
    double x = 0, y = 0;
    double z_m = 0;
    double info = 0, info_z = 0;
};

// Below this depth, or beyond this many squared sigmas, an observation says nothing about where to go: it counts as
// behind the camera. Its cost is a constant, and no number computed from it can overflow.
inline constexpr double kAdjustDepthMin_m = 0.05;
inline constexpr double kAdjustChi2Far = 1e12;

struct SightingResidual {
    double q[3] = {};            // the point in the camera frame, m
    double inverse_z = 0;        // 1/m
    double u = 0, v = 0;         // where it projects to
    double x = 0, y = 0, z = 0;  // residuals: normalised (2), m
    double chi2 = kAdjustChi2Far;
    [[nodiscard]] bool is_far() const noexcept { return chi2 >= kAdjustChi2Far; }
};

[[nodiscard]] inline SightingResidual sighting_residual(const CameraRows& camera, const double point[3],
                                                        const Sighting& s) noexcept {
    SightingResidual out;
    const double* r = camera.r;
    out.q[2] = r[6] * point[0] + r[7] * point[1] + r[8] * point[2] + camera.t[2];
    if (!(out.q[2] >= kAdjustDepthMin_m)) return out;  // NaN too
    out.q[0] = r[0] * point[0] + r[1] * point[1] + r[2] * point[2] + camera.t[0];
    out.q[1] = r[3] * point[0] + r[4] * point[1] + r[5] * point[2] + camera.t[1];
    out.inverse_z = 1.0 / out.q[2];
    out.u = out.q[0] * out.inverse_z;
    out.v = out.q[1] * out.inverse_z;
    out.x = out.u - s.x;
    out.y = out.v - s.y;
    out.z = s.info_z > 0 ? out.q[2] - s.z_m : 0.0;
    const double chi2 = (out.x * out.x + out.y * out.y) * s.info + out.z * out.z * s.info_z;
    if (chi2 < kAdjustChi2Far) out.chi2 = chi2;
    return out;
}

// Huber's cost of a squared residual (rho(s) = s up to the threshold, 2 sqrt(t s) - t beyond) and its derivative.
[[nodiscard]] inline double huber_cost(double chi2, double threshold) noexcept {
    return chi2 <= threshold ? chi2 : 2.0 * std::sqrt(threshold * chi2) - threshold;
}
[[nodiscard]] inline double huber_weight(double chi2, double threshold) noexcept {
    return chi2 <= threshold ? 1.0 : std::sqrt(threshold / chi2);
}

// d(residuals)/d(xi): rows x, y, z. d q / d xi = [-I, [q]x], as q' = exp(-xi) q.
struct PoseRows {
    double x[6], y[6], z[6];
};
[[nodiscard]] inline PoseRows pose_rows(const SightingResidual& r) noexcept {
    const double i = r.inverse_z;
    const double u = r.u, v = r.v;
    return {{-i, 0, u * i, u * v, -(1.0 + u * u), v},
            {0, -i, v * i, 1.0 + v * v, -(u * v), -u},
            {0, 0, -1.0, -r.q[1], r.q[0], 0}};
}

// d(residuals)/d(point in the world): rows x, y, z.
struct PointRows {
    double x[3], y[3], z[3];
};
[[nodiscard]] inline PointRows point_rows(const CameraRows& camera, const SightingResidual& r) noexcept {
    PointRows rows;
    for (int k = 0; k < 3; ++k) {
        const double depth = camera.r[6 + k];
        rows.x[k] = r.inverse_z * (camera.r[k] - r.u * depth);
        rows.y[k] = r.inverse_z * (camera.r[3 + k] - r.v * depth);
        rows.z[k] = depth;
    }
    return rows;
}

}  // namespace stillmesh
