// A window of keyframes before a cloud of points, with known truth: what local adjustment is given.
#pragma once

#include <cmath>
#include <cstdint>
#include <vector>

#include "engine/adjust/bundle.hpp"
#include "engine/adjust/local_adjustment.hpp"
#include "engine/base/random.hpp"
#include "engine/geometry/se3.hpp"

namespace stillmesh::test {

struct WindowOptions {
    std::uint32_t free = 4, fixed = 2;
    std::uint32_t points = 120, observations = 600;  // about
    double sigma_pixel = 1.0 / 525;                  // assumed; drawn when has_noise
    double depth_share = 1.0;                        // of observations that measured depth
    double sigma_z_at_1m = 1.425e-3;
    bool has_noise = true;
    double outlier_share = 0;
    double outlier_scale = 0;  // their noise is so many times larger; 0: they are anywhere in the image, at any depth
    double start_off_m = 0.03, start_off_rad = 0.02;  // of the initial poses; points: the same metres
    std::uint64_t seed = 1;
};

struct Window {
    std::vector<SE3> poses, true_poses;
    std::vector<bool> is_fixed;
    std::vector<Vector3> points, true_points;
    std::vector<AdjustmentObservation> observations;
    std::vector<bool> is_outlier;

    [[nodiscard]] AdjustmentSizes sizes() const {
        AdjustmentSizes sizes;
        for (const bool fixed : is_fixed) ++(fixed ? sizes.fixed_keyframes_max : sizes.free_keyframes_max);
        sizes.points_max = static_cast<std::uint32_t>(points.size());
        sizes.observations_max = static_cast<std::uint32_t>(observations.size());
        return sizes;
    }
    // False: something was refused.
    [[nodiscard]] bool load(LocalAdjustment& adjustment) const {
        adjustment.begin();
        bool is_ok = true;
        for (std::size_t i = 0; i < poses.size(); ++i) is_ok &= adjustment.add_keyframe(poses[i], is_fixed[i]).is_ok();
        for (const Vector3& point : points) is_ok &= adjustment.add_point(point).is_ok();
        for (const AdjustmentObservation& o : observations) is_ok &= adjustment.add_observation(o) == Status::kOk;
        return is_ok;
    }
};

inline Vector3 draw_vector(Random& random, double half) {
    Vector3 v;
    for (int i = 0; i < 3; ++i) v(i) = random.uniform(-half, half);
    return v;
}

inline SE3 draw_motion(Random& random, double metres, double radians) {
    Vector6 xi;
    xi.head<3>() = draw_vector(random, metres);
    xi.tail<3>() = draw_vector(random, radians);
    return se3_exp(xi);
}

// Keyframes go sideways, 8 cm apart, looking at points 1 to 4 m ahead; the fixed ones are the oldest. A point is seen
// by a run of neighbouring keyframes.
inline Window make_window(const WindowOptions& options) {
    Random random(options.seed);
    Window window;
    const std::uint32_t keyframes = options.free + options.fixed;
    for (std::uint32_t i = 0; i < keyframes; ++i) {
        SE3 pose = draw_motion(random, 0.02, 0.1);
        pose.translation.x() += 0.08 * i;
        window.true_poses.push_back(pose);
        window.is_fixed.push_back(i < options.fixed);
        const SE3 off = draw_motion(random, options.start_off_m, options.start_off_rad);
        SE3 start = i < options.fixed ? pose : pose * off;
        renormalise(start.rotation);
        window.poses.push_back(start);
    }
    const double mean = static_cast<double>(options.observations) / options.points;
    for (std::uint32_t p = 0; p < options.points; ++p) {
        double length = 1.0 + random.uniform(0.0, 2.0 * (mean - 1.0)) + 0.5;
        if (length > keyframes) length = keyframes;
        const auto seen_by = static_cast<std::uint32_t>(length);
        const std::uint32_t first = random.below(keyframes - seen_by + 1);
        Vector3 q;
        q.z() = random.uniform(1.0, 4.0);
        q.x() = q.z() * random.uniform(-0.4, 0.4);
        q.y() = q.z() * random.uniform(-0.35, 0.35);
        const Vector3 world = window.true_poses[first + seen_by / 2] * q;
        window.true_points.push_back(world);
        window.points.emplace_back(world + draw_vector(random, options.start_off_m));
        for (std::uint32_t k = first; k < first + seen_by; ++k) {
            const Vector3 seen = window.true_poses[k].inverse() * world;
            AdjustmentObservation o;
            o.keyframe = k;
            o.point = p;
            const bool is_outlier = random.uniform() < options.outlier_share;
            const double scale = (options.has_noise ? 1.0 : 0.0) * (is_outlier ? options.outlier_scale : 1.0);
            const double noise_x = random.normal(), noise_y = random.normal(), noise_z = random.normal();
            const double sigma_z = options.sigma_z_at_1m * seen.z() * seen.z();
            o.x = seen.x() / seen.z() + scale * options.sigma_pixel * noise_x;
            o.y = seen.y() / seen.z() + scale * options.sigma_pixel * noise_y;
            o.var_pixel = options.sigma_pixel * options.sigma_pixel;
            if (random.uniform() < options.depth_share) {
                o.z_m = seen.z() + scale * sigma_z * noise_z;
                o.var_z = sigma_z * sigma_z;
            }
            if (is_outlier && options.outlier_scale == 0) {
                o.x = random.uniform(-0.5, 0.5);
                o.y = random.uniform(-0.4, 0.4);
                if (o.var_z > 0) o.z_m = random.uniform(0.6, 5.0);
            }
            window.observations.push_back(o);
            window.is_outlier.push_back(is_outlier);
        }
    }
    return window;
}

inline Progress run_to_end(LocalAdjustment& adjustment) {
    WorkBudget budget(UINT32_MAX);
    return adjustment.step(budget);
}

}  // namespace stillmesh::test
