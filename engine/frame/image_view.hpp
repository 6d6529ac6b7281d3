// Views of pixels that somebody else owns. No copy, no ownership; borrowed until the call that takes them returns, or
// as that call says.
#pragma once

#include <cstddef>
#include <cstdint>

namespace stillmesh {

template <typename T>
struct ImageView {
    const T* data = nullptr;
    std::uint32_t width = 0;
    std::uint32_t height = 0;
    std::size_t stride = 0;  // elements from one row to the next, >= width * channels

    [[nodiscard]] constexpr const T* row(std::uint32_t y) const noexcept { return data + y * stride; }
    [[nodiscard]] constexpr T at(std::uint32_t x, std::uint32_t y) const noexcept { return row(y)[x]; }
    [[nodiscard]] constexpr bool is_empty() const noexcept { return data == nullptr || width == 0 || height == 0; }
};

template <typename T>
struct MutableImageView {
    T* data = nullptr;
    std::uint32_t width = 0;
    std::uint32_t height = 0;
    std::size_t stride = 0;

    [[nodiscard]] constexpr T* row(std::uint32_t y) const noexcept { return data + y * stride; }
    [[nodiscard]] constexpr ImageView<T> view() const noexcept { return {data, width, height, stride}; }
};

using GreyView = ImageView<std::uint8_t>;
using DepthView = ImageView<std::uint16_t>;

}  // namespace stillmesh
