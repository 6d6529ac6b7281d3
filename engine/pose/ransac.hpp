// Pose of a set of correspondences with outliers (paper 3.1, method.md 6): minimal samples of three points in 3D, the
// paper's iteration rule with a hard cap.
#pragma once

#include <cstdint>
#include <span>

#include "engine/base/random.hpp"
#include "engine/matching/correspondence.hpp"
#include "engine/parameters.hpp"

namespace stillmesh {

struct RansacOptions {
    double confidence = 0.99;  // p
    std::uint32_t factor = 3;  // 3k in the coarse stage, 10k in the final one
    std::uint32_t iterations_max = 507;
    double inlier_ratio_start = 0.5;  // r: the last frame's
    double inlier_ratio_min = 0.3;
    double chi2_max = 11.34;
    double sample_chi2_max = 16.0;
};

// As configured, with as many iterations as inlier_ratio_min needs at most.
[[nodiscard]] RansacOptions ransac_options(const Parameters& configuration, std::uint32_t factor,
                                           double inlier_ratio_start) noexcept;

struct RansacResult {
    SE3 world_from_camera;
    double inlier_share = 0;  // of the weights
    std::uint32_t inliers = 0;
    std::uint32_t iterations = 0;
    bool is_valid = false;
};

// k = ceil(log(1 - p) / log(1 - r^3)), by repeated multiplication; at least 1, at most `cap`.
[[nodiscard]] std::uint32_t ransac_iterations(double confidence, double inlier_ratio, std::uint32_t cap) noexcept;

// The motion that takes three measured points to their places in the world: each triangle spans a frame. False when
// they are nearly on one line or a length differs by more than `chi2_max` times its variance.
[[nodiscard]] bool pose_from_three(const Correspondence& a, const Correspondence& b, const Correspondence& c,
                                   SE3& world_from_camera, double chi2_max = RansacOptions{}.sample_chi2_max) noexcept;

// Only correspondences with depth are sampled; all named ones are counted. `first`: a hypothesis to start from, or
// nullptr.
[[nodiscard]] RansacResult ransac_pose(std::span<const Correspondence> correspondences,
                                       std::span<const std::uint16_t> chosen, const SE3* first,
                                       const RansacOptions& options, Random& random) noexcept;

}  // namespace stillmesh
