#include "engine/tracking/frame_mask.hpp"

#include <algorithm>

#include "engine/base/numbers.hpp"

namespace stillmesh {
namespace {

constexpr std::uint8_t kCovered = 128;  // from here on
constexpr std::uint32_t kStep_px = 8;   // between the pixels that the area in view is summed over
constexpr double kProvenWeight = 0.5;   // of a point that has stood still for most of proven_s

}  // namespace

void FrameMask::begin(const Frame& frame) noexcept {
    mask_ = {};
    if (frame.mask.data == nullptr || !parameters_.is_used) return;
    // A pixel sees an area in proportion to the square of its depth. In the depth image's own units, as whole numbers.
    std::uint64_t all = 0, covered = 0;
    for (std::uint32_t y = kStep_px / 2; y < frame.mask.height; y += kStep_px) {
        for (std::uint32_t x = kStep_px / 2; x < frame.mask.width; x += kStep_px) {
            const std::uint64_t depth = frame.depth.at(x, y);
            all += depth * depth;
            if (frame.mask.at(x, y) >= kCovered) covered += depth * depth;
        }
    }
    if (static_cast<double>(covered) <= parameters_.share_max * static_cast<double>(all)) mask_ = frame.mask;
}

bool FrameMask::covers(float x, float y) const noexcept {
    const auto column = static_cast<std::uint32_t>(std::max(round_clamped(static_cast<double>(x)), 0));
    const auto row = static_cast<std::uint32_t>(std::max(round_clamped(static_cast<double>(y)), 0));
    return mask_.at(std::min(column, mask_.width - 1), std::min(row, mask_.height - 1)) >= kCovered;
}

void FrameMask::weigh(std::span<const Keypoint> keypoints, std::span<Correspondence> matches) const noexcept {
    if (!is_plausible()) return;
    double proven = 0, proven_covered = 0;
    for (const Correspondence& c : matches) {
        if (c.weight < kProvenWeight || !c.has_depth) continue;
        const double area = c.weight * c.p_camera.z() * c.p_camera.z();
        proven += area;
        if (covers(keypoints[c.feature].x, keypoints[c.feature].y)) proven_covered += area;
    }
    if (proven_covered > parameters_.share_max * proven) return;
    for (Correspondence& c : matches) {
        if (covers(keypoints[c.feature].x, keypoints[c.feature].y)) c.weight *= parameters_.weight;
    }
}

}  // namespace stillmesh
