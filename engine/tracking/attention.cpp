#include "engine/tracking/attention.hpp"

#include <array>

#include "engine/base/numbers.hpp"

namespace stillmesh {
namespace {

constexpr std::uint32_t kSide = MovingCells::kSide;
constexpr std::uint32_t kRow = kSide + 2;  // a cell more to each side, in which nothing lies
// A cell's own matches beside those of each neighbour: a cell of 40x30 px has but a few.
constexpr std::uint32_t kOwn = 4;
constexpr std::uint32_t kLeast = 2;

struct Seen {
    std::uint32_t still = 0, moving = 0;
};
using SeenCells = std::array<Seen, std::size_t{kRow} * kRow>;

std::uint32_t cell_of(float at, std::uint32_t length) noexcept {
    return static_cast<std::uint32_t>(floor_clamped(kSide * static_cast<double>(at) / length, 0, kSide - 1));
}

Seen around(const SeenCells& seen, std::uint32_t column, std::uint32_t row) noexcept {
    Seen sum;
    for (std::uint32_t y = row; y <= row + 2; ++y) {
        for (std::uint32_t x = column; x <= column + 2; ++x) {
            const Seen& cell = seen[y * kRow + x];
            const std::uint32_t weight = x == column + 1 && y == row + 1 ? kOwn : 1;
            sum.still += weight * cell.still;
            sum.moving += weight * cell.moving;
        }
    }
    return sum;
}

}  // namespace

MovingCells moving_cells(const CameraModel& camera, std::span<const Keypoint> keypoints,
                         std::span<const Correspondence> matches, std::span<const std::uint16_t> still,
                         std::uint32_t moving_per_still) noexcept {
    SeenCells seen{};
    const auto cell = [&](const Correspondence& match) noexcept -> Seen& {
        const Keypoint& keypoint = keypoints[match.feature];
        const std::uint32_t column = cell_of(keypoint.x, camera.width);
        return seen[(cell_of(keypoint.y, camera.height) + 1) * kRow + column + 1];
    };
    for (const Correspondence& match : matches) cell(match).moving += match.is_moving && match.is_dynamic ? 1U : 0U;
    for (const std::uint16_t i : still) ++cell(matches[i]).still;
    MovingCells cells;
    for (std::uint32_t row = 0; row < kSide; ++row) {
        for (std::uint32_t column = 0; column < kSide; ++column) {
            const Seen here = around(seen, column, row);
            if (here.moving >= kLeast && here.moving >= moving_per_still * here.still) cells.add(column, row);
        }
    }
    return cells;
}

}  // namespace stillmesh
