// The image and ever smaller copies of it, each from the one before by bilinear interpolation in integers. Pixel
// centres: the pixel (x, y) of a level covers the square around it, so that full = (x + 1/2) * full_width / width - 1/2
// and no level is shifted against another. Takes the size of all levels (0.95 MB at 640x480 and 8 levels), and about
// 0.2 ms with AVX2.
#pragma once

#include <cstdint>
#include <span>

#include "engine/base/arena.hpp"
#include "engine/base/status.hpp"
#include "engine/frame/image_view.hpp"
#include "engine/frame/kernels.hpp"
#include "engine/limits.hpp"

namespace stillmesh {

inline constexpr std::uint32_t kPyramidLevelsMax = 12;
// From one level to the next, in thousandths. Memory is planned for the smallest factor.
inline constexpr std::uint32_t kScalePermilleMin = 1200;
inline constexpr std::uint32_t kScalePermilleMax = 1900;
// A corner needs its patch around it: smaller levels are left out.
inline constexpr std::uint32_t kLevelSideMin = 2 * (static_cast<std::uint32_t>(kPatchRadius) + 1) + 1;

// The side of the next level: size / factor, rounded to nearest.
[[nodiscard]] constexpr std::uint32_t next_level_side(std::uint32_t side, std::uint32_t scale_permille) noexcept {
    return (side * 1000 + scale_permille / 2) / scale_permille;
}
[[nodiscard]] constexpr std::size_t level_stride(std::uint32_t width) noexcept {
    return align_up(width, kArenaAlignment);
}
[[nodiscard]] constexpr std::size_t scale_blocks(std::uint32_t width) noexcept {
    return (width + kScaleBlock - 1) / kScaleBlock;
}

class Pyramid {
public:
    static constexpr void plan(ArenaPlan& arena, const Limits& limits) noexcept {
        const Sizes sizes = sizes_max(limits);
        arena.array<std::uint8_t>(sizes.pixels + kKernelSlackBytes);
        arena.array<ScaleBlock>(sizes.blocks);
        arena.array<std::uint8_t>(level_stride(limits.image_width_max) + kKernelSlackBytes);
    }

    // `levels` in 1..limits.pyramid_levels_max, `scale_permille` in its range (CHECK).
    void create(Arena& arena, const Limits& limits, std::uint32_t levels, std::uint32_t scale_permille,
                const Kernels& kernels) noexcept;

    // Replaces all levels. `image` is copied; any size up to the limits.
    //   kOk    kInvalid  empty, larger than the limits, or smaller than kLevelSideMin (the pyramid is then empty)
    [[nodiscard]] Status build(const GreyView& image) noexcept;

    // Levels of the last image; fewer than asked for when it is small. 0 before the first.
    [[nodiscard]] std::uint32_t levels() const noexcept { return levels_; }
    [[nodiscard]] GreyView level(std::uint32_t i) const noexcept {
        STILLMESH_CHECK(i < levels_);
        return views_[i];
    }
    // Where a position of a level lies in the full image, and the other way round. Continuous, in pixels.
    [[nodiscard]] double full_x(std::uint32_t i, double x) const noexcept { return (x + 0.5) * ratio_x(i) - 0.5; }
    [[nodiscard]] double full_y(std::uint32_t i, double y) const noexcept { return (y + 0.5) * ratio_y(i) - 0.5; }
    [[nodiscard]] double level_x(std::uint32_t i, double x) const noexcept { return (x + 0.5) / ratio_x(i) - 0.5; }
    [[nodiscard]] double level_y(std::uint32_t i, double y) const noexcept { return (y + 0.5) / ratio_y(i) - 0.5; }

private:
    // Of all levels, when they shrink the least.
    struct Sizes {
        std::size_t pixels = 0;
        std::size_t blocks = 0;
    };
    [[nodiscard]] static constexpr Sizes sizes_max(const Limits& limits) noexcept {
        Sizes sizes;
        std::uint32_t width = limits.image_width_max;
        std::uint32_t height = limits.image_height_max;
        for (std::uint32_t i = 0; i < limits.pyramid_levels_max; ++i) {
            if (i > 0) {
                width = next_level_side(width, kScalePermilleMin);
                height = next_level_side(height, kScalePermilleMin);
                sizes.blocks += scale_blocks(width);
            }
            sizes.pixels += level_stride(width) * height;
        }
        return sizes;
    }
    [[nodiscard]] double ratio_x(std::uint32_t i) const noexcept {
        return static_cast<double>(views_[0].width) / level(i).width;
    }
    [[nodiscard]] double ratio_y(std::uint32_t i) const noexcept {
        return static_cast<double>(views_[0].height) / level(i).height;
    }
    void lay_out(std::uint32_t width, std::uint32_t height) noexcept;

    const Kernels* kernels_ = nullptr;
    std::span<std::uint8_t> pixels_;
    std::span<ScaleBlock> blocks_;
    std::span<std::uint8_t> scratch_;
    std::uint32_t width_max_ = 0;
    std::uint32_t height_max_ = 0;
    std::uint32_t levels_wanted_ = 0;
    std::uint32_t scale_permille_ = 0;
    std::uint32_t levels_ = 0;
    std::uint32_t laid_out_levels_ = 0;
    GreyView views_[kPyramidLevelsMax];
    std::size_t pixels_begin_[kPyramidLevelsMax] = {};
    std::size_t blocks_begin_[kPyramidLevelsMax] = {};
};

}  // namespace stillmesh
