// A frame's picture as a file in memory, for the report and the page, and bytes as text.
#pragma once

#include <cstdint>
#include <span>
#include <string>
#include <vector>

#include "engine/frame/frame.hpp"

namespace stillmesh {

// Empty when there is no memory for it.
[[nodiscard]] std::vector<std::uint8_t> encode_grey_png(const Frame& frame);
// A small picture for a report: JPEG, or PNG in a build without it. Likewise empty.
[[nodiscard]] std::vector<std::uint8_t> encode_small_picture(std::span<const std::uint8_t> grey, std::uint32_t width,
                                                             std::uint32_t height, bool& is_jpeg);
[[nodiscard]] std::string base64(std::span<const std::uint8_t> bytes);

}  // namespace stillmesh
