// Image files into buffers that the caller owns, told by their content, whatever they are called: PNG (png_reader.hpp),
// JPEG (libjpeg-turbo, if the build has it), PGM and PPM of 8 and 16 bits, and NumPy arrays of 8- and 16-bit numbers.
// What else people have (TIFF, EXR, WebP, BMP) is named, with a command that converts it. Cost: PNG as there; a JPEG of
// 640x480 .6 ms. Memory: files other than PNG are read into a buffer of the thread, of at most kImageFileBytesMax.
#pragma once

#include <cstdint>
#include <span>
#include <string>

#include "engine/base/status.hpp"
#include "hal/replay/image_header.hpp"

namespace stillmesh {

inline constexpr std::size_t kImageFileBytesMax = std::size_t{64} << 20U;

// kUnavailable: no such file.    kCorrupt: broken, or no image.    kInvalid: a format that is not read, or a kind of
// it. `message` is a sentence for the user.
[[nodiscard]] Status read_image_header(const std::string& file, ImageHeader& header, std::string& message);

// The whole image: width x height pixels without padding, 16-bit ones in the processor's byte order. As above; kCorrupt
// also when the file's size or kind is not `expected`, or `pixels` is not exactly as large.
[[nodiscard]] Status read_image(const std::string& file, const ImageHeader& expected, std::span<std::uint8_t> pixels,
                                std::string& message);

// The same for bytes in memory that are no PNG; `name` is only used in messages. Any bytes are safe. An empty `pixels`:
// the header alone.
[[nodiscard]] Status decode_other_image(std::span<const std::uint8_t> bytes, const std::string& name,
                                        ImageHeader& header, std::span<std::uint8_t> pixels, std::string& message);

}  // namespace stillmesh
