#include "engine/tracking/still_depth.hpp"

#include <algorithm>

#include "engine/base/numbers.hpp"
#include "engine/frame/depth_cells.hpp"

namespace stillmesh {
namespace {

// Floor at 3 m, seen from 1.3 m, falls back by .1 m a cell.
constexpr DepthStep kStep{.base_mm = 20, .share_permille = 40};

constexpr std::uint32_t kSamples = 5, kSamplesMin = 3;

}  // namespace

void StillDepth::create(Arena& arena, const Limits& limits, const DepthParameters& range) noexcept {
    range_ = range;
    if (limits.depth_images_max == 0) return;
    depth_mm_ = arena.array<std::uint16_t>(kDepthCellsMax);
    queue_ = arena.array<std::uint16_t>(kDepthCellsMax);
    labels_ = arena.array<Label>(kDepthCellsMax);
}

void StillDepth::begin(const Frame& frame, const DepthImages& images) noexcept {
    columns_ = images.columns();
    rows_ = images.rows();
    cell_px_ = images.cell_px();
    queued_ = 0;
    for (std::uint32_t row = 0; row < rows_; ++row) {
        for (std::uint32_t column = 0; column < columns_; ++column) {
            depth_mm_[std::size_t{row} * columns_ + column] = reduce(frame, column * cell_px_, row * cell_px_);
        }
    }
    std::fill_n(labels_.begin(), std::size_t{columns_} * rows_, Label::kNone);
}

// The median of what was measured at the middle of the cell and halfway to its corners.
std::uint16_t StillDepth::reduce(const Frame& frame, std::uint32_t x, std::uint32_t y) const noexcept {
    const std::uint32_t near = (cell_px_ - 1) / 4, middle = (cell_px_ - 1) / 2, far = cell_px_ - 1 - near;
    const std::uint32_t places[kSamples][2] = {{middle, middle}, {near, near}, {far, near}, {near, far}, {far, far}};
    std::uint16_t sorted[kSamples] = {};
    std::uint32_t count = 0;
    for (const auto& place : places) {
        const std::uint16_t depth = frame.depth.at(x + place[0], y + place[1]);
        if (depth == 0) continue;
        std::uint32_t at = count++;
        for (; at > 0 && sorted[at - 1] > depth; --at) sorted[at] = sorted[at - 1];
        sorted[at] = depth;
    }
    if (count < kSamplesMin) return 0;
    const double z_m = sorted[count / 2] / frame.depth_units_per_m;
    if (z_m < range_.z_min_m || z_m > range_.z_max_m) return 0;
    return static_cast<std::uint16_t>(round_clamped(1000 * z_m, 0, DepthImage::kDepth));
}

void StillDepth::note(const Keypoint& keypoint, double z_m, bool is_moving) noexcept {
    const auto column = static_cast<std::uint32_t>(round_clamped(static_cast<double>(keypoint.x), 0, 65535)) / cell_px_;
    const auto row = static_cast<std::uint32_t>(round_clamped(static_cast<double>(keypoint.y), 0, 65535)) / cell_px_;
    if (column >= columns_ || row >= rows_) return;
    const std::size_t cell = std::size_t{row} * columns_ + column;
    const std::int32_t off_mm = round_clamped(1000 * z_m, 0, 65535) - depth_mm_[cell];
    const auto step = static_cast<std::int32_t>(kStep.base_mm + depth_mm_[cell] * kStep.share_permille / 1000);
    if (depth_mm_[cell] == 0 || off_mm > step || off_mm < -step) return;  // the cell shows another surface
    if (labels_[cell] == Label::kNone) queue_[queued_++] = static_cast<std::uint16_t>(cell);
    if (labels_[cell] != Label::kMoving) labels_[cell] = is_moving ? Label::kMoving : Label::kStill;
}

void StillDepth::reach(std::size_t from, std::size_t to) noexcept {
    if (labels_[to] != Label::kNone || !goes_on(depth_mm_[from], depth_mm_[to], kStep)) return;
    labels_[to] = labels_[from];
    queue_[queued_++] = static_cast<std::uint16_t>(to);
}

void StillDepth::finish(std::span<std::uint16_t> out) noexcept {
    for (std::size_t i = 0; i < queued_; ++i) {
        const std::size_t cell = queue_[i];
        for_each_neighbour(cell, columns_, out.size(), [&](std::size_t to) { reach(cell, to); });
    }
    for (std::uint32_t row = 0; row < rows_; ++row) {
        for (std::uint32_t column = 0; column < columns_; ++column) {
            const std::size_t cell = std::size_t{row} * columns_ + column;
            const bool is_left_out = labels_[cell] != Label::kMoving && is_by_moving(column, row);
            const unsigned mark = labels_[cell] == Label::kMoving ? DepthImage::kMoving : 0U;
            out[cell] = is_left_out ? std::uint16_t{0} : static_cast<std::uint16_t>(depth_mm_[cell] | mark);
        }
    }
}

bool StillDepth::is_by_moving(std::uint32_t column, std::uint32_t row) const noexcept {
    const std::uint32_t row_end = std::min(row + 2, rows_), column_end = std::min(column + 2, columns_);
    for (std::uint32_t y = row > 0 ? row - 1 : 0; y < row_end; ++y) {
        for (std::uint32_t x = column > 0 ? column - 1 : 0; x < column_end; ++x) {
            if (labels_[std::size_t{y} * columns_ + x] == Label::kMoving) return true;
        }
    }
    return false;
}

}  // namespace stillmesh
