// Why a frame gives no pose, from its pixels alone: said to the user when the engine is lost. A coarse grid is looked
// at, some 5000 pixels: microseconds, and only for frames without a measured pose.
#pragma once

#include "engine/frame/frame.hpp"

namespace stillmesh {

enum class FrameFault {
    kNone,
    kBlack,
    kSaturated,
    kNoDepth,
    kCovered,
    kPlain,
    kOutOfRange,
    // What no single frame says:
    kColourStuck,
    kDepthStuck,
    kBothStuck,
    kElsewhere,  // the map does not hold this place
    kOtherMap,   // nor anything of it, and it is one that was read
    kHidden,     // most of what was seen when it was lost moved
    kCamera,     // calibration or depth cannot be right, which is said by itself
};
inline constexpr std::size_t kFrameFaults = 14;

// What the engine uses of the depth.
struct DepthRange {
    double min_m = 0.3;
    double max_m = 6.0;
};

[[nodiscard]] FrameFault diagnose(const Frame& frame, const DepthRange& range = {});
// A sentence's second half with a remedy: "the images are black; is the lens cap on?"
[[nodiscard]] const char* fault_sentence(FrameFault fault);

}  // namespace stillmesh
