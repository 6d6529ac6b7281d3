// Depth images of the same view in larger or smaller pixels than colour's: whether they are, and brought to colour's
// size. Nothing is kept; cost: one pass over the pixels.
#pragma once

#include <cstddef>
#include <cstdint>
#include <span>

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
