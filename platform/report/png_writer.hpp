// A frame's picture as a grey PNG in memory, for the report.
#pragma once

#include <cstdint>
#include <span>
#include <string>
#include <vector>

#include "engine/frame/frame.hpp"

namespace stillmesh {

// Empty when there is no memory for it.
[[nodiscard]] std::vector<std::uint8_t> encode_grey_png(const Frame& frame);
[[nodiscard]] std::string base64(std::span<const std::uint8_t> bytes);

}  // namespace stillmesh
