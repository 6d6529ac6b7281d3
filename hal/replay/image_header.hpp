// What an image file says it is, before its pixels are read.
#pragma once

#include <cstddef>
#include <cstdint>

namespace stillmesh {

enum class ImageKind : std::uint8_t { kGrey8, kRgb8, kGrey16 };  // as it is given out, whatever the file holds

struct ImageHeader {
    std::uint32_t width = 0;   // px
    std::uint32_t height = 0;  // px
    ImageKind kind = ImageKind::kGrey8;
};

[[nodiscard]] constexpr std::size_t bytes_per_pixel(ImageKind kind) noexcept {
    return kind == ImageKind::kGrey8 ? 1 : kind == ImageKind::kGrey16 ? 2 : 3;
}
[[nodiscard]] constexpr const char* kind_text(ImageKind kind) noexcept {
    return kind == ImageKind::kGrey8 ? "8-bit grey" : kind == ImageKind::kGrey16 ? "16-bit grey" : "8-bit RGB";
}

}  // namespace stillmesh
