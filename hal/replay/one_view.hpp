// Depth images of the same view in larger or smaller pixels than colour's: whether they are, by their sizes or their
// cameras, and brought to colour's size. Nothing is kept; cost: one pass over the pixels.
#pragma once

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <span>

#include "engine/geometry/camera_model.hpp"

namespace stillmesh {

struct ImageSize {
    std::uint32_t width = 0;   // px
    std::uint32_t height = 0;  // px
    friend bool operator==(const ImageSize&, const ImageSize&) = default;
};

// A whole number of pixels of one, up to 8 in a row, lies in each of the other's.
[[nodiscard]] constexpr bool is_of_one_view(const ImageSize& one, const ImageSize& other) noexcept {
    constexpr std::uint32_t kRatioMax = 8;
    const ImageSize& large = one.width >= other.width ? one : other;
    const ImageSize& small = one.width >= other.width ? other : one;
    const std::uint32_t ratio = small.width == 0 ? 0 : large.width / small.width;
    return ratio >= 1 && ratio <= kRatioMax && small.width * ratio == large.width &&
           small.height * ratio == large.height;
}

// Whether two cameras, of one place, see the same picture. Distortion is left out.
[[nodiscard]] inline bool is_same_view(const CameraModel& one, const CameraModel& other) noexcept {
    if (!is_of_one_view({one.width, one.height}, {other.width, other.height}) || other.width == 0) return false;
    const double ratio = static_cast<double>(one.width) / other.width;
    const double near_px = 0.5 * std::max(1.0, ratio);  // the centres of larger pixels lie elsewhere
    return std::fabs(one.fx - ratio * other.fx) <= near_px && std::fabs(one.fy - ratio * other.fy) <= near_px &&
           std::fabs(one.cx - ratio * other.cx) <= near_px && std::fabs(one.cy - ratio * other.cy) <= near_px;
}

// Of smaller images each pixel is there several times, of larger ones the middle of each square counts. Both sizes are
// of one view and the spans are as large.
inline void resize_depth(std::span<const std::uint16_t> from, const ImageSize& from_size, std::span<std::uint16_t> to,
                         const ImageSize& to_size) noexcept {
    const bool is_smaller = from_size.width < to_size.width;
    const std::uint32_t ratio = is_smaller ? to_size.width / from_size.width : from_size.width / to_size.width;
    for (std::uint32_t y = 0; y < to_size.height; ++y) {
        const std::uint32_t row = is_smaller ? y / ratio : y * ratio + (ratio - 1) / 2;
        const std::uint16_t* const source = &from[std::size_t{row} * from_size.width];
        std::uint16_t* const target = &to[std::size_t{y} * to_size.width];
        for (std::uint32_t x = 0; x < to_size.width; ++x) {
            target[x] = source[is_smaller ? x / ratio : x * ratio + (ratio - 1) / 2];
        }
    }
}

}  // namespace stillmesh
