// A picture's depth in cells of some pixels, row by row, and what of it is one surface.
#pragma once

#include <algorithm>
#include <cstddef>
#include <cstdint>

namespace stillmesh {

// How far depth may fall back from one cell to the next on one surface: so much, and a share of the nearer depth.
struct DepthStep {
    std::uint32_t base_mm = 0;
    std::uint32_t share_permille = 0;
};

// Whether both lie on one surface; 0: no depth, on none.
[[nodiscard]] constexpr bool goes_on(std::uint32_t a_mm, std::uint32_t b_mm, const DepthStep& step) noexcept {
    const std::uint32_t nearer = std::min(a_mm, b_mm), farther = std::max(a_mm, b_mm);
    return nearer > 0 && farther - nearer <= step.base_mm + nearer * step.share_permille / 1000;
}

// Calls reach(neighbour) for each cell that shares a side with this one.
template <typename Reach>
constexpr void for_each_neighbour(std::size_t cell, std::size_t columns, std::size_t cells, Reach&& reach) {
    const std::size_t column = cell % columns;
    if (column > 0) reach(cell - 1);
    if (column + 1 < columns) reach(cell + 1);
    if (cell >= columns) reach(cell - columns);
    if (cell + columns < cells) reach(cell + columns);
}

}  // namespace stillmesh
