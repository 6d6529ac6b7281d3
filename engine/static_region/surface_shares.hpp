// What a match stands for: the surface around it, in square metres up to a factor. Features crowd on what is printed,
// and a wall with one picture on it has few; but all of the wall is seen in the depth image, and moves as its picture
// does. So the cells of the depth image are dealt out: each goes to the nearest match on the same surface, from cell to
// cell where depth goes on, and no farther than a reach, so that no match speaks for all of a room; matches in one cell
// share. Limit: 40x30 cells, of at least 8 pixels. Memory: 14 KiB. Cost: one sample of depth and some comparisons a
// cell.
#pragma once

#include <algorithm>
#include <cstdint>
#include <span>

#include "engine/base/arena.hpp"
#include "engine/features/features.hpp"
#include "engine/frame/frame.hpp"
#include "engine/limits.hpp"
#include "engine/matching/correspondence.hpp"
#include "engine/parameters.hpp"

namespace stillmesh {

class SurfaceShares {
public:
    static constexpr void plan(ArenaPlan& arena, const Limits& limits) noexcept {
        const std::size_t cells = cells_max(limits);
        arena.array<float>(cells);
        arena.array<std::uint16_t>(cells);
        arena.array<std::uint16_t>(cells);
        arena.array<std::uint16_t>(cells);
        arena.array<std::uint16_t>(cells);
    }
    void create(Arena& arena, const Limits& limits, const Parameters& parameters) noexcept;

    // Sets the extent of each match that has depth.
    void share_out(const Frame& frame, std::span<const Keypoint> keypoints,
                   std::span<Correspondence> correspondences) noexcept;

private:
    static constexpr std::uint16_t kNone = 0xffff;
    static constexpr std::uint32_t kColumnsMax = 40, kRowsMax = 30, kCellMin_px = 8;
    [[nodiscard]] static constexpr std::size_t cells_max(const Limits& limits) noexcept {
        return std::size_t{std::min(limits.image_width_max / kCellMin_px, kColumnsMax)} *
               std::min(limits.image_height_max / kCellMin_px, kRowsMax);
    }
    void begin(const Frame& frame) noexcept;
    void claim_own(std::span<const Keypoint> keypoints, std::span<const Correspondence> correspondences) noexcept;
    void claim_around() noexcept;
    void claim(std::uint16_t from, std::size_t to) noexcept;
    // The cell that a match lies in, if it shows the surface that the match lies on; or kNone.
    [[nodiscard]] std::uint16_t cell_of(const Keypoint& keypoint, double z_m) const noexcept;

    DepthParameters range_;
    double reach_ = 0;
    std::uint32_t columns_ = 0, rows_ = 0, cell_px_ = 1;
    std::size_t queued_ = 0;
    std::span<float> surfaces_;          // of all that an owner has, m^2
    std::span<std::uint16_t> depth_mm_;  // of each cell; 0: none
    std::span<std::uint16_t> owners_;    // cell whose matches have it; or kNone
    std::span<std::uint16_t> queue_;     // cells with an owner, in the order they got it
    std::span<std::uint16_t> counts_;    // matches in a cell
};

}  // namespace stillmesh
