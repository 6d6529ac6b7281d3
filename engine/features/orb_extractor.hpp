// Our own ORB features (Rublee et al. 2011): FAST-9/16 corners on every pyramid level, spread over the image by a
// quadtree, placed to a fraction of a pixel, oriented by their intensity centroid, described by 256 tests of the
// blurred level. Integers throughout, but for the angle and the position that are handed out: the same bits everywhere.
// At most features_max, in the order of levels. Takes 1.7 MB at 640x480 with 8 levels; time see bench/features.
#pragma once

#include <cstdint>
#include <span>

#include "engine/base/arena.hpp"
#include "engine/base/status.hpp"
#include "engine/features/features.hpp"
#include "engine/frame/kernels.hpp"
#include "engine/frame/pyramid.hpp"
#include "engine/limits.hpp"
#include "engine/parameters.hpp"

namespace stillmesh {

struct OrbOptions {
    std::uint32_t features_max = 1000;    // at most Limits::features_max; more are never given out
    std::uint32_t levels = 8;             // at most Limits::pyramid_levels_max
    double scale_factor = 1.2;            // of a level to the next, 1.2 to 1.9, taken in thousandths
    std::uint8_t fast_threshold = 20;     // grey levels
    std::uint8_t fast_threshold_low = 7;  // where a cell of the image has no corner at fast_threshold; >= 1
    // Thousandths of the features that are given out by place alone, the others by quality; 1000 is as even as can be,
    // 0 takes the best wherever they are.
    std::uint32_t even_permille = 250;
    // Thousandths of a level's features that lie where bodies move, at most; more only where other corners lack.
    std::uint32_t moving_permille = 250;
};

// What a configuration asks for.
[[nodiscard]] OrbOptions orb_options(const FeatureParameters& parameters) noexcept;

class OrbExtractor final : public FeatureExtractor {
    // All arrays, for the plan and for the arena. Above plan(): clang evaluates no template that it has not seen.
    template <typename A>
    constexpr void take_arrays(A& arena, const Limits& limits) noexcept {
        const std::uint32_t width = limits.image_width_max;
        const std::uint32_t height = limits.image_height_max;
        arena.take(corners_, corners_of_all_levels(limits));
        arena.take(sorted_, corners_max(width, height));
        arena.take(strengths_, 3 * (level_stride(width) + kKernelSlackBytes));
        arena.take(maxima_, width + kKernelSlackBytes);
        arena.take(cells_, cells_max(width, height));
        arena.take(blurred_, level_stride(width) * height + kKernelSlackBytes);
        arena.take(blur_scratch_, level_stride(width) + 2 * kKernelSlackBytes);
    }

public:
    static constexpr void plan(ArenaPlan& arena, const Limits& limits) noexcept {
        Pyramid::plan(arena, limits);
        OrbExtractor().take_arrays(arena, limits);
    }
    // Options out of range are our bug (CHECK): configuration is validated before it comes here.
    void create(Arena& arena, const Limits& limits, const OrbOptions& options, const Kernels& kernels) noexcept;

    [[nodiscard]] Status extract(const GreyView& image, FeatureSet& features) noexcept override;
    void set_moving(const MovingCells& moving) noexcept override { moving_ = moving; }

    // Of the last image.
    [[nodiscard]] const Pyramid& pyramid() const noexcept { return pyramid_; }

private:
    // Corners are kept as one number: score (9 bits), whether FAST finds them at the high threshold (1), y, then x.
    static constexpr std::uint32_t kCoordinateBits = 11;  // images up to 2047
    static constexpr std::uint32_t kCoordinateMask = (1u << kCoordinateBits) - 1;
    static constexpr std::uint32_t kStrongBit = 1u << (2 * kCoordinateBits);
    static constexpr std::uint32_t kScoreShift = 2 * kCoordinateBits + 1;
    static constexpr std::uint32_t kScores = 1u << (32 - kScoreShift);
    // Corners are collected on at most one pixel in so many. Ordinary images stay far below; in noise the weakest go.
    static constexpr std::uint32_t kPixelsPerCorner = 16;
    // The side of a cell that chooses between the two thresholds, in pixels of its level.
    static constexpr std::uint32_t kCellSide = 32;

    static constexpr std::size_t corners_max(std::uint32_t width, std::uint32_t height) noexcept {
        return static_cast<std::size_t>(width) * height / kPixelsPerCorner;
    }
    static constexpr std::size_t corners_of_all_levels(const Limits& limits) noexcept {
        std::size_t corners = 0;
        std::uint32_t width = limits.image_width_max;
        std::uint32_t height = limits.image_height_max;
        for (std::uint32_t i = 0; i < limits.pyramid_levels_max; ++i) {
            corners += corners_max(width, height);
            width = next_level_side(width, kScalePermilleMin);
            height = next_level_side(height, kScalePermilleMin);
        }
        return corners;
    }
    static constexpr std::size_t cells_max(std::uint32_t width, std::uint32_t height) noexcept {
        return static_cast<std::size_t>((width + kCellSide - 1) / kCellSide) * ((height + kCellSide - 1) / kCellSide);
    }
    struct LevelCorners {
        std::uint32_t begin = 0;   // in corners_
        std::uint32_t strong = 0;  // that many first ones: those that the threshold of their cell lets through
        std::uint32_t moving = 0;  // of those the last ones: where bodies move
        std::uint32_t count = 0;   // all
        std::uint32_t wanted = 0;  // how many become features
    };

    void find_corners(std::uint32_t level) noexcept;
    void thin_out(std::uint32_t begin, std::uint32_t& end, std::uint32_t& score_min) noexcept;
    void put_strong_first(std::uint32_t level, std::uint32_t width) noexcept;
    void put_moving_last(std::uint32_t level) noexcept;
    void share_out(std::uint32_t total) noexcept;
    [[nodiscard]] std::uint32_t spread(std::span<std::uint32_t> corners, std::uint32_t wanted) noexcept;
    void rate(const GreyView& image, std::span<std::uint32_t> corners) noexcept;
    void select(std::uint32_t level) noexcept;
    void blur(std::uint32_t level) noexcept;
    void describe(std::uint32_t level, FeatureSet& features) noexcept;

    OrbOptions options_;
    MovingCells moving_;
    const Kernels* kernels_ = nullptr;
    Pyramid pyramid_;
    std::uint32_t levels_ = 0;
    LevelCorners level_corners_[kPyramidLevelsMax];
    std::span<std::uint32_t> corners_;
    std::span<std::uint32_t> sorted_;
    std::span<std::uint8_t> strengths_;  // three rows
    std::size_t strengths_stride_ = 0;
    std::span<std::uint16_t> maxima_;  // of a row
    std::span<std::uint8_t> cells_;
    std::span<std::uint8_t> blurred_;  // one level
    std::span<std::uint8_t> blur_scratch_;
};

}  // namespace stillmesh
