// PNG files into buffers that the caller owns, through libspng. Grey of 8 and 16 bits as it is; all other kinds (RGB of
// 16 bits, palettes, alpha, which is left out, grey of fewer bits) as 8-bit RGB. Sizes are compared with the buffer
// before anything is decoded. Cost: some 2 ms for 640x480 grey, 4 ms for RGB; 96 KiB a thread for libspng and zlib,
// taken once (a larger image: from the heap, each time).
#pragma once

#include <cstdint>
#include <span>
#include <string>

#include "engine/base/status.hpp"
#include "hal/replay/image_header.hpp"

namespace stillmesh {

// kUnavailable: no such file.    kCorrupt: not a PNG, or broken.    `message` is a sentence for the user.
[[nodiscard]] Status read_png_header(const std::string& file, ImageHeader& header, std::string& message);

// Decodes the whole image: width x height pixels without padding, 16-bit ones in the processor's byte order.
// As above; kCorrupt also when the file's size or kind is not `expected`, or `pixels` is not exactly as large.
[[nodiscard]] Status read_png(const std::string& file, const ImageHeader& expected, std::span<std::uint8_t> pixels,
                              std::string& message);

// The same for bytes in memory; `name` is only used in messages. Any bytes are safe.
[[nodiscard]] Status decode_png_header(std::span<const std::uint8_t> bytes, const std::string& name,
                                       ImageHeader& header, std::string& message);
[[nodiscard]] Status decode_png(std::span<const std::uint8_t> bytes, const std::string& name,
                                const ImageHeader& expected, std::span<std::uint8_t> pixels, std::string& message);

}  // namespace stillmesh
