#include "platform/cli/frame_diagnosis.hpp"

namespace stillmesh {

FrameFault diagnose(const Frame& frame, const DepthRange& range) {
    const std::uint32_t channels = channels_of(frame.format);
    std::uint32_t pixels = 0, dark = 0, bright = 0, with_depth = 0, near = 0, in_range = 0, edges = 0;
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
            const double depth_m = static_cast<double>(depth) / frame.depth_units_per_m;
            if (depth > 0 && depth_m < 0.5) ++near;
            if (depth > 0 && depth_m >= range.min_m && depth_m <= range.max_m) ++in_range;
        }
    }
    if (pixels == 0 || dark * 10 > pixels * 9) return FrameFault::kBlack;
    if (bright * 10 > pixels * 9) return FrameFault::kSaturated;
    // A lens against a wall measures nothing, or something very near, and sees no edges.
    if (edges * 100 < pixels && (with_depth * 20 < pixels || near * 2 > with_depth)) return FrameFault::kCovered;
    if (with_depth * 50 < pixels) return FrameFault::kNoDepth;
    if (in_range * 50 < pixels) return FrameFault::kOutOfRange;
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
        case FrameFault::kOutOfRange:
            return "the depth lies outside the range that is used, depth.z_min_m to depth.z_max_m; go nearer or "
                   "farther, "
                   "or is the depth unit wrong?";
        case FrameFault::kColourStuck:
            return "the colour images repeat to the bit; plug the camera in again, or record anew";
        case FrameFault::kDepthStuck:
            return "the depth images repeat to the bit; plug the camera in again, or record anew";
        case FrameFault::kBothStuck: return "the images repeat to the bit; plug the camera in again, or record anew";
        case FrameFault::kElsewhere:
            return "enough stands still here, but this place is not in the map; go back to where it was, or begin a "
                   "new "
                   "map with --new-map-when-lost";
        case FrameFault::kOtherMap:
            return "enough stands still here, but nothing of it is in the map that was read; is that the map of "
                   "another "
                   "place? Leave --map-in out, or begin a new map with --new-map-when-lost";
        case FrameFault::kHidden:
            return "most of what was seen when it was lost moved; wait until that has gone by, show the camera more of "
                   "the room, or, if it was taken elsewhere, begin a new map with --new-map-when-lost";
        case FrameFault::kCamera: return "calibration and depth do not fit what is seen, as said before";
        case FrameFault::kNone: break;
    }
    return "too few features stood still; move slower, or give the camera more of the room to see";
}

}  // namespace stillmesh
