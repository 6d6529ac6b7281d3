// How coarse a pyramid level is, and how unsure that makes where its features are: the scale of each level, and the
// variance of a normalised coordinate measured there. Cost: a table.
#pragma once

#include <cstdint>
#include <span>

#include "engine/frame/pyramid.hpp"
#include "engine/geometry/camera_model.hpp"
#include "engine/parameters.hpp"

namespace stillmesh {

inline constexpr double kScaleSlack = 1.6;  // at most, between a feature's scale and the one expected

// How far real noise leaves the model's: factors of the variances.
struct NoiseFactors {
    double pixel = 1.0;
    double depth = 1.0;
};

class PixelNoise {
public:
    void create(const Parameters& configuration, const CameraModel& camera) noexcept {
        double scale = 1.0;
        for (double& s : scale_) {
            s = scale;
            scale *= configuration.features.scale_factor;
        }
        levels_ = configuration.features.levels;
        const double sigma = configuration.depth.sigma_pixel;
        var_base_ = sigma * sigma / (camera.fx * camera.fy);
    }
    [[nodiscard]] double scale(std::uint8_t level) const noexcept { return scale_[level]; }
    [[nodiscard]] double var(std::uint8_t level) const noexcept { return var_base_ * scale_[level] * scale_[level]; }
    // As many as the pyramid has levels.
    [[nodiscard]] std::span<const double> scales() const noexcept {
        return std::span<const double>(scale_).first(levels_);
    }

private:
    double scale_[kPyramidLevelsMax] = {};
    double var_base_ = 0;
    std::uint32_t levels_ = 0;
};

}  // namespace stillmesh
