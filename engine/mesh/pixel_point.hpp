// Mesh coordinates: raw pixels on a 1/8 px grid. Images are at most 2047 px wide, so a coordinate is below 2^14.
#pragma once

#include <cstdint>

namespace stillmesh {

inline constexpr std::int32_t kMeshUnitsPerPixel = 8;
inline constexpr std::int32_t kMeshCoordinateMax = 2047 * kMeshUnitsPerPixel + kMeshUnitsPerPixel - 1;

struct PixelPoint {
    std::int32_t x = 0;  // 1/8 px
    std::int32_t y = 0;  // 1/8 px
    friend constexpr bool operator==(PixelPoint, PixelPoint) noexcept = default;
};

}  // namespace stillmesh
