#include "platform/cli/frame_diagnosis.hpp"

namespace stillmesh {

FrameFault diagnose(const Frame& frame) {
    const std::uint32_t channels = channels_of(frame.format);
    std::uint32_t pixels = 0, dark = 0, bright = 0, with_depth = 0, near = 0, edges = 0;
    for (std::uint32_t y = 4; y < frame.colour.height; y += 8) {
        for (std::uint32_t x = 4; x < frame.colour.width; x += 8) {
            // Green of colour images: close enough to brightness for this.
            const std::size_t at = std::size_t{x} * channels + (channels == 3 ? 1 : 0);
            const int value = frame.colour.row(y)[at];
            const int before = frame.colour.row(y)[at - std::size_t{2} * channels];
            const int above = frame.colour.row(y - 2)[at];
            const std::uint16_t depth = frame.depth.at(x, y);
            ++pixels;
            if (value < 12) ++dark;
            if (value > 243) ++bright;
            if (value - before > 12 || before - value > 12 || value - above > 12 || above - value > 12) ++edges;
            if (depth > 0) ++with_depth;
            if (depth > 0 && static_cast<double>(depth) < 0.5 * frame.depth_units_per_m) ++near;
        }
    }
    if (pixels == 0 || dark * 10 > pixels * 9) return FrameFault::kBlack;
    if (bright * 10 > pixels * 9) return FrameFault::kSaturated;
    // A lens against a wall measures nothing, or something very near, and sees no edges.
    if (edges * 100 < pixels && (with_depth * 20 < pixels || near * 2 > with_depth)) return FrameFault::kCovered;
    if (with_depth * 50 < pixels) return FrameFault::kNoDepth;
    if (edges * 100 < pixels) return FrameFault::kPlain;
    return FrameFault::kNone;
}

const char* fault_sentence(FrameFault fault) {
    switch (fault) {
        case FrameFault::kBlack: return "the images are black; switch on a light or take the cap off the lens";
        case FrameFault::kSaturated: return "the images are saturated; lower the exposure";
        case FrameFault::kNoDepth:
            return "the depth images are nearly empty; is the depth camera on and within 0.5 to 4.5 m?";
        case FrameFault::kCovered: return "something covers the camera; move it away from the wall";
        case FrameFault::kPlain: return "the images show hardly any texture; turn the camera to something with corners";
        case FrameFault::kNone: break;
    }
    return "too few features stood still; move slower, or give the camera more of the room to see";
}

}  // namespace stillmesh
