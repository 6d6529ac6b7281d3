#include "platform/camera_check/depth_edges.hpp"

#include <algorithm>
#include <cstdlib>

namespace stillmesh {
namespace {

constexpr int kRowStep = 2;
constexpr int kShadow_px = 24;    // without depth, beside what is near
constexpr int kJumpShare = 10;    // of the farther depth, one part
constexpr int kContrastMax = 48;  // grey levels: one lamp must not count for all

int brightness(const std::uint8_t* row, std::uint32_t channels, int x) {
    return row[static_cast<std::uint32_t>(x) * channels + (channels == 3 ? 1U : 0U)];
}

}  // namespace

void add_depth_edges(const Frame& frame, EdgeCurve& curve) {
    const std::uint32_t channels = channels_of(frame.format);
    const int width = static_cast<int>(frame.depth.width);
    for (std::uint32_t y = 1; y + 1 < frame.depth.height; y += kRowStep) {
        const std::uint16_t* const depth = frame.depth.row(y);
        const std::uint8_t* const grey = frame.colour.row(y);
        int last = -1;  // with depth
        for (int x = kEdgeShiftMax_px + 1; x + kEdgeShiftMax_px + 1 < width; ++x) {
            if (depth[x] == 0) continue;
            const int before = last;
            last = x;
            if (before < 0 || x - before > kShadow_px) continue;
            const int a = depth[before], b = depth[x];
            if (std::abs(a - b) * kJumpShare < std::max(a, b)) continue;
            const int border = a < b ? before : x;  // what is near has the border
            for (int shift = -kEdgeShiftMax_px; shift <= kEdgeShiftMax_px; ++shift) {
                const int contrast = std::abs(brightness(grey, channels, border + shift + 1) -
                                              brightness(grey, channels, border + shift - 1));
                curve.contrast[static_cast<std::size_t>(shift + kEdgeShiftMax_px)] += std::min(contrast, kContrastMax);
            }
            curve.borders += 1;
        }
    }
}

}  // namespace stillmesh
