// A frame as it enters the engine: views of colour (or grey) and depth with their times. Validated once, in
// Engine::submit; nothing behind that door checks sizes again.
#pragma once

#include <cstdint>

#include "engine/frame/image_view.hpp"

namespace stillmesh {

enum class PixelFormat : std::uint8_t { kGrey8 = 1, kRgb8 = 3, kBgr8 = 4 };

[[nodiscard]] constexpr std::uint32_t channels_of(PixelFormat format) noexcept {
    return format == PixelFormat::kGrey8 ? 1 : 3;
}

struct Frame {
    std::int64_t time_ns = 0;        // of the colour image; the pose is for this instant
    std::int64_t depth_time_ns = 0;  // of the depth image; 0 or time_ns: not known
    PixelFormat format = PixelFormat::kGrey8;
    ImageView<std::uint8_t> colour;  // width x height pixels; stride in bytes
    // Registered to colour, same size; 0 = no measurement. Its stride is in pixels of 16 bits: half the bytes.
    DepthView depth;
    double depth_units_per_m = 5000.0;
    // Optional, of colour's size: from 128 on, what a detector takes for a person or another body that may move. One
    // witness among others: it may be late, coarse or wrong. No data: nothing is said.
    ImageView<std::uint8_t> mask;
};

}  // namespace stillmesh
