// PNG files into buffers that the caller owns, through libspng. Only what recordings hold: 8-bit grey or RGB for
// colour, 16-bit grey for depth. Sizes are compared with the buffer before anything is decoded. Cost: some 2 ms for
// 640x480 grey, 4 ms for RGB; 96 KiB a thread for libspng and zlib,
// taken once (a larger image: from the heap, each time).
#pragma once

#include <cstdint>
#include <span>
#include <string>

#include "engine/base/status.hpp"

namespace stillmesh {

enum class PngKind : std::uint8_t { kGrey8, kRgb8, kGrey16 };

struct PngHeader {
    std::uint32_t width = 0;
    std::uint32_t height = 0;
    PngKind kind = PngKind::kGrey8;
};

// kUnavailable: no such file.    kCorrupt: not a PNG, or broken.    kInvalid: a kind of PNG not listed above.
// `message` is a sentence for the user.
[[nodiscard]] Status read_png_header(const std::string& file, PngHeader& header, std::string& message);

// Decodes the whole image: width x height pixels without padding, 16-bit ones in the processor's byte order.
// As above; kCorrupt also when the file's size or kind is not `expected`, or `pixels` is not exactly as large.
[[nodiscard]] Status read_png(const std::string& file, const PngHeader& expected, std::span<std::uint8_t> pixels,
                              std::string& message);

// The same for bytes in memory; `name` is only used in messages. Any bytes are safe.
[[nodiscard]] Status decode_png_header(std::span<const std::uint8_t> bytes, const std::string& name, PngHeader& header,
                                       std::string& message);
[[nodiscard]] Status decode_png(std::span<const std::uint8_t> bytes, const std::string& name, const PngHeader& expected,
                                std::span<std::uint8_t> pixels, std::string& message);

[[nodiscard]] constexpr std::size_t bytes_per_pixel(PngKind kind) noexcept {
    return kind == PngKind::kGrey8 ? 1 : kind == PngKind::kGrey16 ? 2 : 3;
}

}  // namespace stillmesh
