// Why a frame gives no pose, from its pixels alone: said to the user when the engine is lost. A coarse grid is looked
// at, some 5000 pixels: microseconds, and only for frames without a measured pose.
#pragma once

#include "engine/frame/frame.hpp"

namespace stillmesh {

enum class FrameFault { kNone, kBlack, kSaturated, kNoDepth, kCovered, kPlain };

[[nodiscard]] FrameFault diagnose(const Frame& frame);
// A sentence's second half with a remedy: "the images are black; is the lens cap on?"
[[nodiscard]] const char* fault_sentence(FrameFault fault);

}  // namespace stillmesh
