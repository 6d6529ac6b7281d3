#include "engine/pose/ransac.hpp"

#include <algorithm>
#include <cmath>

#include "engine/pose/residual.hpp"

namespace stillmesh {
namespace {

// Smaller triangles, or sides nearly opposite, fix no rotation.
constexpr double kAreaMin_m2 = 2e-3;  // of the parallelogram
constexpr double kLengthMin_m = 2e-2;
constexpr double kMiddleMin = 1e-3;
constexpr std::uint32_t kIterationsMax = 1000;  // k, whatever the configuration asks for

}  // namespace

RansacOptions ransac_options(const Parameters& configuration, std::uint32_t factor,
                             double inlier_ratio_start) noexcept {
    RansacOptions options;
    options.inlier_ratio_start = inlier_ratio_start;
    options.confidence = configuration.pose.confidence;
    options.factor = factor;
    options.inlier_ratio_min = configuration.pose.inlier_ratio_min;
    options.iterations_max = factor * ransac_iterations(options.confidence, options.inlier_ratio_min, kIterationsMax);
    options.sample_chi2_max = configuration.pose.sample_chi2_max;
    options.chi2_max = configuration.region.point_chi2_max;
    return options;
}

std::uint32_t ransac_iterations(double confidence, double inlier_ratio, std::uint32_t cap) noexcept {
    const double miss = 1.0 - inlier_ratio * inlier_ratio * inlier_ratio;  // a sample with an outlier in it
    if (!(miss > 0.0)) return 1;
    double left = miss;
    std::uint32_t k = 1;
    while (left > 1.0 - confidence && k < cap) {
        left *= miss;
        ++k;
    }
    return k;
}

bool pose_from_three(const Correspondence& a, const Correspondence& b, const Correspondence& c, SE3& world_from_camera,
                     double chi2_max) noexcept {
    const Vector3 camera_u = b.p_camera - a.p_camera;
    const Vector3 camera_v = c.p_camera - a.p_camera;
    const Vector3 world_u = b.p_world - a.p_world;
    const Vector3 world_v = c.p_world - a.p_world;
    // A rigid motion keeps lengths: most wrong samples end here.
    const auto keeps_length = [chi2_max](const Vector3& p, const Vector3& q, double var) {
        const double lp = std::sqrt(p.squaredNorm());
        const double lq = std::sqrt(q.squaredNorm());
        return (lp - lq) * (lp - lq) <= chi2_max * var;
    };
    const double var_a = a.var_z + a.map_var_z;
    const double var_b = b.var_z + b.map_var_z;
    const double var_c = c.var_z + c.map_var_z;
    if (!keeps_length(camera_u, world_u, var_a + var_b) || !keeps_length(camera_v, world_v, var_a + var_c) ||
        !keeps_length(c.p_camera - b.p_camera, c.p_world - b.p_world, var_b + var_c)) {
        return false;
    }
    const auto frame_of = [](const Vector3& u, const Vector3& v, Matrix3& frame) {
        const Vector3 normal = u.cross(v);
        const double area = std::sqrt(normal.squaredNorm());
        const double length = std::sqrt(u.squaredNorm());
        if (!(area > kAreaMin_m2) || !(length > kLengthMin_m)) return false;
        // The axis through the middle of both sides spreads the error of the points evenly.
        const Vector3 middle = u / length + v / std::sqrt(v.squaredNorm());
        const double middle_length = std::sqrt(middle.squaredNorm());
        if (!(middle_length > kMiddleMin)) return false;
        const Vector3 x = middle / middle_length;
        const Vector3 z = normal / area;
        frame.col(0) = x;
        frame.col(1) = z.cross(x);
        frame.col(2) = z;
        return true;
    };
    Matrix3 camera_frame, world_frame;
    if (!frame_of(camera_u, camera_v, camera_frame) || !frame_of(world_u, world_v, world_frame)) return false;
    world_from_camera.rotation.noalias() = world_frame * camera_frame.transpose();
    const Vector3 camera_mean = (a.p_camera + b.p_camera + c.p_camera) / 3.0;
    const Vector3 world_mean = (a.p_world + b.p_world + c.p_world) / 3.0;
    Vector3 turned;
    turned.noalias() = world_from_camera.rotation * camera_mean;
    world_from_camera.translation = world_mean - turned;
    return true;
}

namespace {

struct Support {
    double weight = 0;
    std::uint32_t inliers = 0;
};

// Stops where the weights that are left cannot make it better than `best_weight`: most wrong hypotheses end early.
Support support_of(std::span<const Correspondence> correspondences, std::span<const std::uint16_t> chosen,
                   const SE3& world_from_camera, double chi2_max, double weight_all, double best_weight) noexcept {
    Support support;
    const SE3 camera_from_world = world_from_camera.inverse();
    const double missed_max = weight_all - best_weight;
    double missed = 0;
    for (const std::uint16_t index : chosen) {
        const Correspondence& c = correspondences[index];
        if (chi2_of(c, camera_from_world) <= chi2_max) {
            support.weight += c.weight;
            ++support.inliers;
        } else {
            missed += c.weight;
            if (missed > missed_max) break;
        }
    }
    return support;
}

}  // namespace

RansacResult ransac_pose(std::span<const Correspondence> correspondences, std::span<const std::uint16_t> chosen,
                         const SE3* first, const RansacOptions& options, Random& random) noexcept {
    RansacResult best;
    double weight_all = 0;
    std::uint32_t with_depth = 0;
    for (const std::uint16_t index : chosen) {
        weight_all += correspondences[index].weight;
        with_depth += correspondences[index].has_depth ? 1U : 0U;
    }
    double best_weight = -1;
    const auto consider = [&](const SE3& hypothesis) {
        const Support support =
            support_of(correspondences, chosen, hypothesis, options.chi2_max, weight_all, best_weight);
        if (support.weight > best_weight) {
            best_weight = support.weight;
            best.world_from_camera = hypothesis;
            best.inliers = support.inliers;
            best.is_valid = true;
        }
    };
    if (first != nullptr) consider(*first);
    const auto count = static_cast<std::uint32_t>(chosen.size());
    if (with_depth >= 3) {
        const auto wanted = [&] {
            double ratio = options.inlier_ratio_start;
            if (best_weight >= 0 && weight_all > 0 && best_weight / weight_all > ratio)
                ratio = best_weight / weight_all;
            if (ratio < options.inlier_ratio_min) ratio = options.inlier_ratio_min;
            const std::uint32_t k =
                options.factor * ransac_iterations(options.confidence, ratio, options.iterations_max);
            return std::min(k, options.iterations_max);
        };
        std::uint32_t limit = wanted();
        for (; best.iterations < limit; ++best.iterations) {
            // One that is drawn twice spans no triangle, which pose_from_three() asks for.
            const std::uint32_t i = random.below(count);
            const std::uint32_t j = random.below(count);
            const std::uint32_t k = random.below(count);
            const Correspondence& a = correspondences[chosen[i]];
            const Correspondence& b = correspondences[chosen[j]];
            const Correspondence& c = correspondences[chosen[k]];
            if (!a.has_depth || !b.has_depth || !c.has_depth) continue;
            SE3 hypothesis;
            if (!pose_from_three(a, b, c, hypothesis, options.sample_chi2_max)) continue;
            const double before = best_weight;
            consider(hypothesis);
            if (best_weight > before) limit = wanted();
        }
    }
    best.inlier_share = weight_all > 0 && best_weight > 0 ? best_weight / weight_all : 0.0;
    return best;
}

}  // namespace stillmesh
