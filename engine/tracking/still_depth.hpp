// The small depth image of a frame that becomes a keyframe, with what moves marked. A cell's depth is the median of
// five pixels, so that neither a hole nor a smear at a border is one. What moves is known of features alone: each cell
// takes the verdict of the nearest feature, going from cell to cell where depth goes on; cells that moving features
// claim are marked, those beside them left out. What no feature reaches stays: later keyframes that look through its
// place say that it has gone. Limit: 80x60 cells. Memory: 24 KiB. Cost: six passes over the cells.
#pragma once

#include <cstdint>
#include <span>

#include "engine/map/depth_images.hpp"
#include "engine/tracking/measured_frame.hpp"

namespace stillmesh {

class StillDepth {
public:
    static constexpr void plan(ArenaPlan& arena, const Limits& limits) noexcept {
        if (limits.depth_images_max == 0) return;
        arena.array<std::uint16_t>(kDepthCellsMax);
        arena.array<std::uint16_t>(kDepthCellsMax);
        arena.array<Label>(kDepthCellsMax);
    }
    void create(Arena& arena, const Limits& limits, const DepthParameters& range) noexcept;

    // A frame, and the cells of `images`, which are on.
    void begin(const Frame& frame, const DepthImages& images) noexcept;
    // Features of that frame with what is known of each; one of which nothing is known is not told.
    void note(const Keypoint& keypoint, double z_m, bool is_moving) noexcept;
    // The image, row by row, as DepthImage has it.
    void finish(std::span<std::uint16_t> out) noexcept;

private:
    enum class Label : std::uint8_t { kNone, kStill, kMoving };
    [[nodiscard]] std::uint16_t reduce(const Frame& frame, std::uint32_t x, std::uint32_t y) const noexcept;
    void reach(std::size_t from, std::size_t to) noexcept;
    [[nodiscard]] bool is_by_moving(std::uint32_t column, std::uint32_t row) const noexcept;

    DepthParameters range_;
    std::uint32_t columns_ = 0, rows_ = 0, cell_px_ = 1;
    std::size_t queued_ = 0;
    std::span<std::uint16_t> depth_mm_;
    std::span<std::uint16_t> queue_;  // cells with a label, in the order they got it
    std::span<Label> labels_;
};

}  // namespace stillmesh
