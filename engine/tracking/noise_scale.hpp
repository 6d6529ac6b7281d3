// How far real noise leaves the model's: rooms, lenses and hands differ from any noise model by factors. The measured
// variance of the pixel residuals and of the depth residuals over the modelled ones, followed by their medians from
// frame to frame; raised at once when no motion explains the frame. Limit: features_max residuals. Cost: two passes
// over the matches looked at, and two selections of a median.
#pragma once

#include <cstdint>
#include <span>

#include "engine/base/fixed_vector.hpp"
#include "engine/geometry/pixel_noise.hpp"
#include "engine/limits.hpp"
#include "engine/matching/correspondence.hpp"
#include "engine/parameters.hpp"
#include "engine/static_region/static_region.hpp"

namespace stillmesh {

class NoiseScale {
public:
    static constexpr void plan(ArenaPlan& arena, const Limits& limits) noexcept {
        FixedVector<float>::plan(arena, limits.features_max);
    }
    void create(Arena& arena, const Limits& limits, const NoiseParameters& parameters) noexcept;
    void reset() noexcept;

    [[nodiscard]] const NoiseFactors& factors() const noexcept { return factors_; }
    // What has been measured since goes with it.
    void restore(const NoiseFactors& factors) noexcept { factors_ = measured_ = factors; }
    // Before a frame; what is raised in it is a guess, which undo() takes back and adapt() measures.
    void begin_frame() noexcept {
        before_ = factors_;
        is_raised_ = false;
    }
    void undo() noexcept { factors_ = before_; }
    // In the first frames little is known, and more is tried and believed.
    [[nodiscard]] bool is_young() const noexcept { return frames_ < parameters_->young_frames; }
    [[nodiscard]] std::uint32_t tries_max() const noexcept {
        return frames_ == 0 ? 2 * parameters_->tries : parameters_->tries;
    }
    void raise() noexcept;

    // From the residuals of the `chosen` under one motion; with `groups` of each body under its own motion
    // (`world_from_camera` where it has none).
    void adapt(std::span<const Correspondence> correspondences, std::span<const std::uint16_t> chosen,
               const SE3& world_from_camera, const StaticRegion* groups = nullptr) noexcept;
    void count_frame() noexcept { ++frames_; }
    [[nodiscard]] std::uint32_t frames() const noexcept { return frames_; }  // that it was measured in

private:
    const NoiseParameters* parameters_ = nullptr;  // outlives it
    NoiseFactors factors_;
    NoiseFactors before_;    // the frame
    NoiseFactors measured_;  // last
    bool is_raised_ = false;
    std::uint32_t frames_ = 0;  // that they were measured in
    FixedVector<float> residuals_;
};

}  // namespace stillmesh
