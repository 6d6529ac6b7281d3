// One picture into one PNG file, fast rather than small.
#pragma once

#include <cstddef>
#include <cstdint>
#include <string>

namespace stillmesh {

enum class PngPixels : std::uint8_t { kGrey8, kRgb8, kGrey16 };

// `pixels` without padding between rows, in the processor's byte order. Empty, or why it failed.
[[nodiscard]] std::string write_png_file(const std::string& file, const void* pixels, std::uint32_t width,
                                         std::uint32_t height, PngPixels kind);

}  // namespace stillmesh
