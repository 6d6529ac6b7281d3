// Motion-only adjustment (paper 2.1, method.md 6): the pose that minimises the robust (Huber) sum of reprojection and
// depth residuals over fixed points, by Gauss-Newton with damping. At most `iterations_max` passes over the points.
#pragma once

#include <cstdint>
#include <span>

#include "engine/matching/correspondence.hpp"

namespace stillmesh {

struct PoseFit {
    SE3 world_from_camera;
    Matrix6 information = Matrix6::Zero();  // of xi (right increment); Gauss-Newton Hessian of the last pass
    std::uint32_t inliers = 0;              // chi2 below the threshold at the result
    double mean_chi2 = 0;                   // of the inliers
    bool is_valid = false;                  // false: fewer than 3 points or a singular system
};

// What is expected before the frame is looked at, and how surely: sigmas of each component of xi in pose * exp(xi).
struct MotionPrior {
    SE3 world_from_camera;
    double sigma_m = 0.01;
    double sigma_rad = 0.01;
};

// Uses the correspondences named by `chosen`, each weighted by its weight, relative to the largest.
[[nodiscard]] PoseFit optimise_pose(std::span<const Correspondence> correspondences,
                                    std::span<const std::uint16_t> chosen, const SE3& world_from_camera_guess,
                                    double chi2_max, std::uint32_t iterations_max,
                                    const MotionPrior* prior = nullptr) noexcept;

// Inverse of a symmetric positive definite matrix by Cholesky; false when it is not.
[[nodiscard]] bool invert_spd(const Matrix6& matrix, Matrix6& inverse) noexcept;

}  // namespace stillmesh
