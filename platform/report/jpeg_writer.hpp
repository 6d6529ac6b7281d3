// A grey picture as a JPEG in memory. Needs TurboJPEG (STILLMESH_WITH_JPEG, which hal/replay decides).
#pragma once

#include <cstdint>
#include <span>
#include <vector>

namespace stillmesh {

// Rows of `width` bytes without gaps. False: not in this build, or no memory for it.
[[nodiscard]] bool encode_grey_jpeg(std::span<const std::uint8_t> grey, std::uint32_t width, std::uint32_t height,
                                    std::vector<std::uint8_t>& bytes);

}  // namespace stillmesh
