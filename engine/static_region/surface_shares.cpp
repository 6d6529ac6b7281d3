#include "engine/static_region/surface_shares.hpp"

#include "engine/base/numbers.hpp"
#include "engine/frame/depth_cells.hpp"

namespace stillmesh {
namespace {

// Floor at 3 m, seen from 1.3 m, falls back by .2 m a cell.
constexpr DepthStep kStep{.base_mm = 30, .share_permille = 80};

std::uint16_t millimetres(double z_m) noexcept {
    return static_cast<std::uint16_t>(round_clamped(1000 * z_m, 0, 65535));
}

}  // namespace

void SurfaceShares::create(Arena& arena, const Limits& limits, const Parameters& parameters) noexcept {
    const std::size_t cells = cells_max(limits);
    range_ = parameters.depth;
    reach_ = parameters.region.reach;
    surfaces_ = arena.array<float>(cells);
    depth_mm_ = arena.array<std::uint16_t>(cells);
    owners_ = arena.array<std::uint16_t>(cells);
    queue_ = arena.array<std::uint16_t>(cells);
    counts_ = arena.array<std::uint16_t>(cells);
}

void SurfaceShares::share_out(const Frame& frame, std::span<const Keypoint> keypoints,
                              std::span<Correspondence> correspondences) noexcept {
    begin(frame);
    claim_own(keypoints, correspondences);
    claim_around();
    for (std::size_t i = 0; i < queued_; ++i) {
        const float z_m = static_cast<float>(depth_mm_[queue_[i]]) / 1000.0F;
        surfaces_[owners_[queue_[i]]] += z_m * z_m;
    }
    for (Correspondence& c : correspondences) {
        const std::uint16_t cell = c.has_depth ? cell_of(keypoints[c.feature], c.p_camera.z()) : kNone;
        if (cell == kNone) continue;
        c.extent = static_cast<double>(surfaces_[cell]) / (counts_[cell] * c.p_camera.z() * c.p_camera.z());
    }
}

// Depth in the middle of each cell, and nobody's.
void SurfaceShares::begin(const Frame& frame) noexcept {
    const std::uint32_t width = frame.depth.width, height = frame.depth.height;
    cell_px_ = std::max({(width + kColumnsMax - 1) / kColumnsMax, (height + kRowsMax - 1) / kRowsMax, kCellMin_px});
    columns_ = width / cell_px_;
    rows_ = height / cell_px_;
    for (std::uint32_t row = 0; row < rows_; ++row) {
        for (std::uint32_t column = 0; column < columns_; ++column) {
            const std::uint16_t units = frame.depth.at(column * cell_px_ + cell_px_ / 2, row * cell_px_ + cell_px_ / 2);
            const double z_m = units / frame.depth_units_per_m;
            const bool is_in = z_m >= range_.z_min_m && z_m <= range_.z_max_m;
            depth_mm_[row * columns_ + column] = is_in ? millimetres(z_m) : std::uint16_t{0};
        }
    }
    const std::size_t cells = std::size_t{columns_} * rows_;
    std::fill_n(surfaces_.begin(), cells, 0.0F);
    std::fill_n(owners_.begin(), cells, kNone);
    std::fill_n(counts_.begin(), cells, std::uint16_t{0});
    queued_ = 0;
}

std::uint16_t SurfaceShares::cell_of(const Keypoint& keypoint, double z_m) const noexcept {
    const auto column = static_cast<std::uint32_t>(keypoint.x) / cell_px_;
    const auto row = static_cast<std::uint32_t>(keypoint.y) / cell_px_;
    if (column >= columns_ || row >= rows_) return kNone;
    const std::uint32_t cell = row * columns_ + column;
    return goes_on(millimetres(z_m), depth_mm_[cell], kStep) ? static_cast<std::uint16_t>(cell) : kNone;
}

void SurfaceShares::claim_own(std::span<const Keypoint> keypoints,
                              std::span<const Correspondence> correspondences) noexcept {
    for (const Correspondence& c : correspondences) {
        const std::uint16_t cell = c.has_depth ? cell_of(keypoints[c.feature], c.p_camera.z()) : kNone;
        if (cell == kNone || counts_[cell]++ > 0) continue;
        owners_[cell] = cell;
        queue_[queued_++] = cell;
    }
}

// Ring by ring around all of them at once.
void SurfaceShares::claim_around() noexcept {
    const auto rings = static_cast<std::uint32_t>(round_clamped(reach_ * columns_, 0, kColumnsMax));
    std::size_t i = 0;
    for (std::uint32_t ring = 0; ring < rings; ++ring) {
        const std::size_t end = queued_;
        for (; i < end; ++i) {
            const std::uint16_t cell = queue_[i];
            for_each_neighbour(cell, columns_, std::size_t{columns_} * rows_, [&](std::size_t to) { claim(cell, to); });
        }
    }
}

void SurfaceShares::claim(std::uint16_t from, std::size_t to) noexcept {
    if (owners_[to] != kNone || !goes_on(depth_mm_[from], depth_mm_[to], kStep)) return;
    owners_[to] = owners_[from];
    queue_[queued_++] = static_cast<std::uint16_t>(to);
}

}  // namespace stillmesh
