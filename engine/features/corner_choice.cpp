// Which corners of a level become features: strong before weak, still before moving, as many as the level's share.
#include <algorithm>
#include <cstring>

#include "engine/features/orb_extractor.hpp"

namespace stillmesh {

// Two thresholds: where a cell has a corner at the high one, its weaker corners come last.
void OrbExtractor::put_strong_first(std::uint32_t level, std::uint32_t width) noexcept {
    LevelCorners& found = level_corners_[level];
    const std::uint32_t cells_across = (width + kCellSide - 1) / kCellSide;
    const auto cell_of = [cells_across](std::uint32_t corner) noexcept {
        return (corner >> kCoordinateBits & kCoordinateMask) / kCellSide * cells_across +
               (corner & kCoordinateMask) / kCellSide;
    };
    const std::span<std::uint32_t> corners = corners_.subspan(found.begin, found.count);
    std::memset(cells_.data(), 0, cells_.size());
    for (const std::uint32_t corner : corners)
        if ((corner & kStrongBit) != 0) cells_[cell_of(corner)] = 1;
    std::uint32_t strong = 0;
    std::uint32_t weak = 0;
    for (const std::uint32_t corner : corners) {
        // Written to both, counted in one: which it is cannot be predicted.
        const bool is_strong = (corner & kStrongBit) != 0 || cells_[cell_of(corner)] == 0;
        corners[strong] = corner;
        sorted_[weak] = corner;
        strong += is_strong ? 1 : 0;
        weak += is_strong ? 0 : 1;
    }
    std::memcpy(corners.data() + strong, sorted_.data(), weak * sizeof(std::uint32_t));
    found.strong = strong;
}

// Of the strong corners those where bodies move come last.
void OrbExtractor::put_moving_last(std::uint32_t level) noexcept {
    if (moving_.is_empty()) return;
    constexpr std::uint32_t kShift = 20;
    const GreyView image = pyramid_.level(level);
    const std::uint32_t per_column = (MovingCells::kSide << kShift) / image.width;  // cells to a pixel, rounded down
    const std::uint32_t per_row = (MovingCells::kSide << kShift) / image.height;
    LevelCorners& found = level_corners_[level];
    const std::span<std::uint32_t> corners = corners_.subspan(found.begin, found.strong);
    std::uint32_t still = 0;
    for (const std::uint32_t corner : corners) {
        const bool moves = moving_.holds((corner & kCoordinateMask) * per_column >> kShift,
                                         (corner >> kCoordinateBits & kCoordinateMask) * per_row >> kShift);
        corners[still] = corner;
        sorted_[found.moving] = corner;
        still += moves ? 0 : 1;
        found.moving += moves ? 1 : 0;
    }
    std::memcpy(corners.data() + still, sorted_.data(), found.moving * sizeof(std::uint32_t));
}

// How many features each level gives: in proportion to its side, so that each scale of the world is served alike; what
// a level lacks the others give, first of their strong corners, then of the weak ones.
void OrbExtractor::share_out(std::uint32_t total) noexcept {
    std::uint32_t sides = 0;
    for (std::uint32_t i = 0; i < levels_; ++i) sides += pyramid_.level(i).width + pyramid_.level(i).height;
    std::uint32_t left = total;
    for (std::uint32_t i = 0; i < levels_; ++i) {
        const GreyView level = pyramid_.level(i);
        LevelCorners& corners = level_corners_[i];
        const std::uint32_t share = std::min(left, (total * (level.width + level.height) + sides / 2) / sides);
        corners.wanted = std::min(share, corners.strong);
        left -= corners.wanted;
    }
    for (std::uint32_t i = 0; i < levels_; ++i) {
        LevelCorners& corners = level_corners_[i];
        const std::uint32_t more = std::min(left, corners.strong - corners.wanted);
        corners.wanted += more;
        left -= more;
    }
    for (std::uint32_t i = 0; i < levels_; ++i) {
        LevelCorners& corners = level_corners_[i];
        const std::uint32_t more = std::min(left, corners.count - corners.wanted);
        corners.wanted += more;
        left -= more;
    }
}

// Leaves the level's features as the first `wanted` of its corners.
void OrbExtractor::select(std::uint32_t level) noexcept {
    LevelCorners& found = level_corners_[level];
    const GreyView image = pyramid_.level(level);
    const std::span<std::uint32_t> corners = corners_.subspan(found.begin, found.count);
    rate(image, corners.first(found.strong));
    if (found.wanted <= found.strong) {
        const std::uint32_t still = found.strong - found.moving;
        const std::uint32_t lacking = found.wanted > still ? found.wanted - still : 0;
        const std::uint32_t allowed = std::min(found.moving, found.wanted * options_.moving_permille / 1000);
        const std::uint32_t from_moving = std::max(allowed, lacking);
        const std::uint32_t taken = spread(corners.first(still), found.wanted - from_moving);
        const std::uint32_t moving = spread(corners.subspan(still, found.moving), from_moving);
        STILLMESH_CHECK(taken + moving == found.wanted);
        std::memmove(corners.data() + taken, corners.data() + still, moving * sizeof(std::uint32_t));
    } else {
        rate(image, corners.subspan(found.strong));
        const std::uint32_t taken = spread(corners.subspan(found.strong), found.wanted - found.strong);
        STILLMESH_CHECK(found.strong + taken == found.wanted);
    }
}

}  // namespace stillmesh
