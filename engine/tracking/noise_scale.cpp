#include "engine/tracking/noise_scale.hpp"

#include <algorithm>

#include "engine/pose/residual.hpp"

namespace stillmesh {

void NoiseScale::create(Arena& arena, const Limits& limits, const NoiseParameters& parameters) noexcept {
    residuals_.create(arena, limits.features_max);
    parameters_ = &parameters;
    reset();
}

void NoiseScale::reset() noexcept {
    factors_ = {parameters_->pixel_start, parameters_->depth_start};
    measured_ = factors_;
    frames_ = 0;
    begin_frame();
}

// Guesses do not pile up: at most a frame's tries above what was measured last.
void NoiseScale::raise() noexcept {
    is_raised_ = true;
    const NoiseParameters& p = *parameters_;
    NoiseFactors most = measured_;
    for (std::uint32_t i = 0; i < tries_max(); ++i) {
        most.pixel *= p.pixel_try_factor;
        most.depth *= p.depth_try_factor;
    }
    factors_.pixel = std::min({factors_.pixel * p.pixel_try_factor, most.pixel, p.max});
    factors_.depth = std::min({factors_.depth * p.depth_try_factor, most.depth, p.max});
}

void NoiseScale::adapt(std::span<const Correspondence> correspondences, std::span<const std::uint16_t> chosen,
                       const SE3& world_from_camera, const StaticRegion* groups) noexcept {
    const SE3 camera_from_world = world_from_camera.inverse();
    // Medians of squared normalised residuals over those of chi-square with two degrees of freedom and with one.
    constexpr double kMedian2 = 1.386;
    constexpr double kMedian1 = 0.455;
    const NoiseParameters& p = *parameters_;
    const double fall = is_young() || is_raised_ ? p.fall_young : p.fall;
    const double rise = is_young() ? p.depth_try_factor : p.rise;
    for (const bool is_depth : {false, true}) {
        residuals_.clear();
        for (const std::uint16_t i : chosen) {
            const Correspondence& c = correspondences[i];
            const SE3* const own = groups != nullptr ? groups->own_motion(i) : nullptr;
            const Vector3 q = own != nullptr ? own->inverse() * c.p_world : camera_from_world * c.p_world;
            if (!c.has_depth || q.z() < kDepthMin_m) continue;
            const Residual r = residual_of(c, q, c.map_var_lateral, c.map_var_z);
            const double chi2 = is_depth ? r.z * r.z * r.info_z : r.x * r.x * r.info_x + r.y * r.y * r.info_y;
            STILLMESH_CHECK(residuals_.push(static_cast<float>(chi2)));
        }
        if (residuals_.size() < p.residuals_min) return;
        auto* const middle = residuals_.begin() + residuals_.size() / 2;
        std::nth_element(residuals_.begin(), middle, residuals_.end());
        const double ratio = static_cast<double>(*middle) / (is_depth ? kMedian1 : kMedian2);
        double& noise = is_depth ? factors_.depth : factors_.pixel;
        const double floor = is_depth ? p.depth_min : p.pixel_min;
        noise = std::clamp(noise * std::clamp(ratio, fall, rise), floor, p.max);
    }
    measured_ = factors_;
}

}  // namespace stillmesh
