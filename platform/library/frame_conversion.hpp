// Images as cameras and other programs have them, brought into what a Frame takes: depth as float metres, colour with a
// fourth channel, YUV. Header only, no library. Memory: the caller's, packed (a row begins where the last one ended).
// Cost: one pass. Nothing here fails; sizes are the caller's to hold.
#pragma once

#include <cstddef>
#include <cstdint>
#include <span>

#include "engine/base/check.hpp"
#include "engine/frame/frame.hpp"

namespace stillmesh {

// Pixels whose rows are `stride_bytes` apart.
struct PixelBytes {
    const void* data = nullptr;
    std::uint32_t width = 0;
    std::uint32_t height = 0;
    std::size_t stride_bytes = 0;

    template <typename T>
    [[nodiscard]] const T* row(std::uint32_t y) const noexcept {
        return reinterpret_cast<const T*>(static_cast<const std::byte*>(data) + y * stride_bytes);
    }
    [[nodiscard]] std::size_t pixels() const noexcept { return std::size_t{width} * height; }
};

// Depth of 16 bits as a Frame has it, whose stride is in pixels: of a whole number of them.
[[nodiscard]] inline DepthView depth_view(const PixelBytes& depth) noexcept {
    STILLMESH_CHECK(depth.stride_bytes % sizeof(std::uint16_t) == 0);
    return {static_cast<const std::uint16_t*>(depth.data), depth.width, depth.height,
            depth.stride_bytes / sizeof(std::uint16_t)};
}

// Float metres (ROS's and OpenCV's 32FC1). NaN, infinity, what is not positive and what does not fit into 16 bits are
// 0: not measured. `out`: as many as there are pixels. Rounded to the nearest; with 5000 units to the metre that is .1
// mm, and depth ends at 13.1 m.
[[nodiscard]] inline DepthView depth_from_float(const PixelBytes& metres, double units_per_m,
                                                std::span<std::uint16_t> out) noexcept {
    STILLMESH_CHECK(out.size() >= metres.pixels());
    std::uint16_t* to = out.data();
    for (std::uint32_t y = 0; y < metres.height; ++y) {
        const float* const from = metres.row<float>(y);
        for (std::uint32_t x = 0; x < metres.width; ++x) {
            const double units = static_cast<double>(from[x]) * units_per_m + 0.5;
            *to++ = units >= 1.0 && units < 65536.0 ? static_cast<std::uint16_t>(units) : std::uint16_t{0};
        }
    }
    return {out.data(), metres.width, metres.height, metres.width};
}

// Four bytes a pixel, of which the last means nothing: BGRA becomes BGR (PixelFormat::kBgr8), RGBA RGB. `out`: three
// bytes a pixel.
[[nodiscard]] inline ImageView<std::uint8_t> colour_from_four(const PixelBytes& four,
                                                              std::span<std::uint8_t> out) noexcept {
    STILLMESH_CHECK(out.size() >= 3 * four.pixels());
    std::uint8_t* to = out.data();
    for (std::uint32_t y = 0; y < four.height; ++y) {
        const std::uint8_t* from = four.row<std::uint8_t>(y);
        for (std::uint32_t x = 0; x < four.width; ++x, from += 4) {
            *to++ = from[0];
            *to++ = from[1];
            *to++ = from[2];
        }
    }
    return {out.data(), four.width, four.height, std::size_t{3} * four.width};
}

// The luma of YUYV (YUY2, V4L2's YUYV; `luma_first` false: UYVY), which is all that the engine sees of a picture
// (PixelFormat::kGrey8). `out`: a byte a pixel.
[[nodiscard]] inline ImageView<std::uint8_t> grey_from_yuyv(const PixelBytes& yuyv, std::span<std::uint8_t> out,
                                                            bool luma_first = true) noexcept {
    STILLMESH_CHECK(out.size() >= yuyv.pixels());
    std::uint8_t* to = out.data();
    for (std::uint32_t y = 0; y < yuyv.height; ++y) {
        const std::uint8_t* const from = yuyv.row<std::uint8_t>(y) + (luma_first ? 0 : 1);
        for (std::uint32_t x = 0; x < yuyv.width; ++x) *to++ = from[std::size_t{2} * x];
    }
    return {out.data(), yuyv.width, yuyv.height, yuyv.width};
}

}  // namespace stillmesh
