// The pixel formats of video nodes that are understood, by their four-character codes, and what each becomes: RGB or
// grey for the engine, 16-bit depth as it is. Every conversion is exact: the same bits on every processor. Memory: none
// of its own. Cost: 0.7 ms for YUV of 640x480; for JPEG what libjpeg-turbo takes.
#pragma once

#include <cstdint>
#include <span>
#include <string>

#include "engine/base/status.hpp"
#include "engine/frame/frame.hpp"
#include "hal/v4l2/v4l2_link.hpp"

namespace stillmesh::v4l2 {

[[nodiscard]] constexpr std::uint32_t fourcc(const char (&code)[5]) noexcept {
    std::uint32_t value = 0;
    for (std::uint32_t i = 0; i < 4; ++i) {
        value |= std::uint32_t{static_cast<std::uint8_t>(code[i])} << (8 * i);
    }
    return value;
}
inline constexpr std::uint32_t kZ16 = fourcc("Z16 ");
inline constexpr std::uint32_t kY16 = fourcc("Y16 ");
inline constexpr std::uint32_t kGrey = fourcc("GREY");
inline constexpr std::uint32_t kY8i = fourcc("Y8I ");
inline constexpr std::uint32_t kUyvy = fourcc("UYVY");
inline constexpr std::uint32_t kYuyv = fourcc("YUYV");
inline constexpr std::uint32_t kRgb3 = fourcc("RGB3");
inline constexpr std::uint32_t kMjpg = fourcc("MJPG");

// "YUYV"; what is not printable becomes '?'.
[[nodiscard]] std::string fourcc_text(std::uint32_t code);
// Of one pixel as it is transferred; 0: compressed, or not understood.
[[nodiscard]] std::uint32_t bytes_per_pixel(std::uint32_t code) noexcept;
[[nodiscard]] constexpr bool is_depth(std::uint32_t code) noexcept {
    return code == kZ16 || code == kY16;
}
[[nodiscard]] constexpr bool is_colour(std::uint32_t code) noexcept {
    return code == kGrey || code == kY8i || code == kUyvy || code == kYuyv || code == kRgb3 || code == kMjpg;
}
// What the engine gets of a colour format.
[[nodiscard]] constexpr PixelFormat engine_format(std::uint32_t code) noexcept {
    return code == kGrey || code == kY8i ? PixelFormat::kGrey8 : PixelFormat::kRgb8;
}
// This build decodes MJPG.
[[nodiscard]] bool has_jpeg() noexcept;
// An image of `format` with so many bytes is whole.
[[nodiscard]] bool is_whole(const V4l2Format& format, std::size_t bytes_used) noexcept;

// `bytes`: a whole image of `format`, one of is_colour(). `pixels`: width x height without padding, exactly as large
// (CHECK).    kOk    kCorrupt: a JPEG that is broken or of another size; `message` says why
[[nodiscard]] Status convert_colour(const V4l2Format& format, std::span<const std::uint8_t> bytes,
                                    std::span<std::uint8_t> pixels, std::string& message);

}  // namespace stillmesh::v4l2
