#include "platform/grid/occupancy_grid.hpp"

#include <algorithm>
#include <bit>
#include <cmath>

#include "engine/base/check.hpp"

namespace stillmesh {
namespace {

constexpr std::uint32_t kRayStride = 2;  // cells of a depth image, of rays; surfaces are taken from all
constexpr int kHitWeight = 2, kMissWeight = 1;
constexpr int kCountMin = -3, kCountMax = 4;
constexpr int kOccupied = 3;           // surfaces of two images
constexpr float kEndGap_m = 0.1F;      // rays say nothing of it
constexpr float kGrazingGap_m = 0.4F;  // nor of this in the layer where they end
constexpr float kFloorDeep_m = 0.3F;   // what lies lower is no floor
constexpr float kJoined_m = 0.3F;  // so far apart two cells of an image, one above the other, show one level surface
constexpr float kJoinedStep_m = 0.03F;
constexpr unsigned kSteps = 16;                             // of a layer
constexpr unsigned kMargin_steps = 4;                       // beyond a surface: a flat one is crossed by few rays
constexpr unsigned kMoment_frames = 5, kApart_moments = 3;  // half a second between first and last, as a rule
constexpr unsigned kMoves = 1;                              // the floor's bit of what was seen
// Above: nothing stands there. Of a scene in which people sit at desks one cell in 860 is lost by it, of one in which
// they walk none; six looks bring back what was put where they walked.
constexpr int kMovers = 8, kMoversMax = 16, kMoverWeight = 1, kStandsWeight = 2;
constexpr unsigned kHitsMin = 4;         // fewer pixels of an image are no obstacle
constexpr unsigned kNoise_percent = 15;  // hit less often than the cell beside it by so much: noise of that

}  // namespace

void OccupancyGrid::create(std::span<std::byte> block, const GridOptions& options) noexcept {
    STILLMESH_CHECK(block.size() >= bytes(options));
    options_ = options;
    cells_ = {reinterpret_cast<Cell*>(block.data()), options.cells_max};
    low_m_ = static_cast<float>(options.obstacle_m);
    high_m_ = static_cast<float>(options.robot_m);
    layers_per_m_ = static_cast<float>(kLayers - 1) / (high_m_ - low_m_);
    cells_per_m_ = static_cast<float>(1 / options.resolution_m);
    begin();
}

void OccupancyGrid::begin() noexcept {
    x_min_ = y_min_ = 1e9F;
    x_max_ = y_max_ = -1e9F;
    width_ = height_ = 0;
    look_ = 0;
    is_cut_ = false;
}

OccupancyGrid::Eye OccupancyGrid::eye_of(const RigidTransform& level_from_camera) noexcept {
    const RotationMatrix rotation = matrix_of(level_from_camera.rotation_xyzw);
    Eye eye;
    for (std::size_t i = 0; i < 9; ++i) eye.r[i] = static_cast<float>(rotation[i]);
    const auto& t = level_from_camera.translation_m;
    eye.at = {static_cast<float>(t[0]), static_cast<float>(t[1]), static_cast<float>(t[2])};
    return eye;
}

inline OccupancyGrid::Point OccupancyGrid::point_of(const DepthImage& depth, std::size_t cell,
                                                    const Eye& eye) noexcept {
    const float z = static_cast<float>(depth.depth_mm[cell] & DepthImage::kDepth) * 1e-3F;
    const float x = depth.rays[2 * cell] * z, y = depth.rays[2 * cell + 1] * z;
    const float(&r)[9] = eye.r;
    return {eye.at.x + r[0] * x + r[1] * y + r[2] * z, eye.at.y + r[3] * x + r[4] * y + r[5] * z,
            eye.at.z + r[6] * x + r[7] * y + r[8] * z};
}

void OccupancyGrid::cover(const DepthImage& depth, const RigidTransform& level_from_camera) noexcept {
    const Eye eye = eye_of(level_from_camera);
    const auto far_mm = static_cast<std::uint16_t>(std::min(options_.range_m * 1000, 1.0 * DepthImage::kDepth));
    for (std::size_t cell = 0; cell < depth.depth_mm.size(); cell += kRayStride) {
        if (depth.depth_mm[cell] == 0 || depth.depth_mm[cell] > far_mm) continue;  // or something that moves
        const Point p = point_of(depth, cell, eye);
        if (p.z > high_m_) continue;
        x_min_ = std::min(x_min_, p.x);
        x_max_ = std::max(x_max_, p.x);
        y_min_ = std::min(y_min_, p.y);
        y_max_ = std::max(y_max_, p.y);
    }
}

// With a border of two cells; too large, as much as there is room for about the middle.
void OccupancyGrid::lay_out() noexcept {
    if (!(x_max_ >= x_min_)) return;
    const double side = options_.resolution_m;
    double x0 = std::floor(static_cast<double>(x_min_) / side) - 2,
           y0 = std::floor(static_cast<double>(y_min_) / side) - 2;
    double columns = std::ceil(static_cast<double>(x_max_) / side) + 2 - x0;
    double rows = std::ceil(static_cast<double>(y_max_) / side) + 2 - y0;
    const double cells_max = options_.cells_max;
    is_cut_ = columns * rows > cells_max;
    if (is_cut_) {
        const double square = std::floor(std::sqrt(cells_max));
        const double columns_kept = std::min(columns, std::max(square, std::floor(cells_max / rows)));
        const double rows_kept = std::min(rows, std::floor(cells_max / columns_kept));
        x0 += std::floor(0.5 * (columns - columns_kept));
        y0 += std::floor(0.5 * (rows - rows_kept));
        columns = columns_kept;
        rows = rows_kept;
    }
    origin_x_ = x0 * side;
    origin_y_ = y0 * side;
    width_ = static_cast<std::uint32_t>(columns);
    height_ = static_cast<std::uint32_t>(rows);
    std::fill_n(cells_.begin(), std::size_t{width_} * height_, Cell{});
}

inline OccupancyGrid::Cell* OccupancyGrid::cell_at(float x, float y) noexcept {
    const float column = (x - static_cast<float>(origin_x_)) * cells_per_m_;
    const float row = (y - static_cast<float>(origin_y_)) * cells_per_m_;
    if (!(column >= 0 && row >= 0 && column < static_cast<float>(width_) && row < static_cast<float>(height_))) {
        return nullptr;
    }
    return &cells_[static_cast<std::size_t>(row) * width_ + static_cast<std::size_t>(column)];
}

// 0: the floor; -1: none.
inline int OccupancyGrid::layer_of(float z) const noexcept {
    if (z < -kFloorDeep_m || z >= high_m_) return -1;
    return z < low_m_ ? 0 : std::min(1 + static_cast<int>((z - low_m_) * layers_per_m_), kLayers - 1);
}

void OccupancyGrid::add(const DepthImage& depth, const RigidTransform& level_from_camera) noexcept {
    if (width_ == 0) return;
    if (look_ == 0) first_frame_ = depth.frame;
    const std::uint64_t moment = std::min<std::uint64_t>((depth.frame - first_frame_) / kMoment_frames, 65535);
    if (look_ == 0 || moment != moment_) ++look_;
    moment_ = static_cast<std::uint16_t>(moment);
    const Eye eye = eye_of(level_from_camera);
    const auto far_mm = static_cast<std::uint16_t>(std::min(options_.range_m * 1000, 1.0 * DepthImage::kDepth));
    for (std::uint32_t row = 0; row < depth.rows; ++row) {
        for (std::uint32_t column = 0; column < depth.columns; ++column) {
            const std::size_t i = std::size_t{row} * depth.columns + column;
            if (depth.depth_mm[i] == 0) continue;
            const Point p = point_of(depth, i, eye);
            if (depth.is_moving(i)) {
                leave(p);
                continue;
            }
            if (depth.depth_mm[i] <= far_mm) {
                hit(p);
                const std::size_t below = i + depth.columns;
                if (row + 1 < depth.rows && depth.is_still(below)) join(p, point_of(depth, below, eye));
            }
            if (row % kRayStride == 0 && column % kRayStride == 0) look_through(eye.at, p);
        }
    }
}

// Nothing above the floor.
bool OccupancyGrid::is_empty(const Cell& cell) noexcept {
    return std::all_of(cell.counts + 1, cell.counts + kLayers, [](std::int8_t count) { return count <= 0; });
}

unsigned OccupancyGrid::step_of(float z, int layer) const noexcept {
    const float above = (z - low_m_) * layers_per_m_ - static_cast<float>(layer - 1);
    return static_cast<unsigned>(std::clamp(above * kSteps, 0.0F, kSteps - 1.0F));
}

void OccupancyGrid::hit(const Point& p) noexcept {
    const int layer = layer_of(p.z);
    Cell* const cell = layer < 0 ? nullptr : cell_at(p.x, p.y);
    if (cell == nullptr) return;
    renew(*cell, look_);
    const bool is_first = (cell->hit & ~1U) == 0;  // above the floor, in this look
    cell->hit = static_cast<std::uint8_t>(cell->hit | 1U << static_cast<unsigned>(layer));
    if (layer == 0) return;
    if (cell->hits < 65535) ++cell->hits;
    if (is_first && is_empty(*cell)) cell->since = moment_;
    cell->last = moment_;
    Span& span = cell->spans[layer];
    const unsigned step = step_of(p.z, layer);
    if (step < span.low) span.low = step & 15U;
    if (step > span.high) span.high = step & 15U;
}

// What moves stands on no obstacle: whatever was seen there was it, or went before it came.
void OccupancyGrid::leave(const Point& p) noexcept {
    const int layer = layer_of(p.z);
    Cell* const cell = layer < 1 ? nullptr : cell_at(p.x, p.y);
    if (cell == nullptr) return;
    renew(*cell, look_);
    cell->seen = static_cast<std::uint8_t>(cell->seen | kMoves | 1U << static_cast<unsigned>(layer));
}

// A level surface seen at a flat angle is hit here and there: what lies between two of its cells is part of it.
void OccupancyGrid::join(const Point& a, const Point& b) noexcept {
    const float dx = b.x - a.x, dy = b.y - a.y, dz = b.z - a.z;
    if (a.z < low_m_ || a.z >= high_m_ || std::abs(dz) > kJoinedStep_m) return;
    const float apart = std::sqrt(dx * dx + dy * dy), step = 1 / cells_per_m_;
    if (apart > kJoined_m) return;
    for (float at = step; at < apart; at += step) {
        const float share = at / apart;
        hit({a.x + dx * share, a.y + dy * share, a.z + dz * share});
    }
}

// The part of the ray between robot's height and floor, a step a cell.
void OccupancyGrid::look_through(const Point& eye, const Point& end) noexcept {
    const float dx = end.x - eye.x, dy = end.y - eye.y, dz = end.z - eye.z;
    const float across = std::sqrt(dx * dx + dy * dy);
    if (across < kEndGap_m) return;
    const float fall = dz / across;  // per metre across
    float from = 0, to = std::min(across - kEndGap_m, static_cast<float>(options_.range_m));
    if (fall < 0) {
        from = std::max(from, (high_m_ - eye.z) / fall);
        to = std::min(to, (low_m_ - eye.z) / fall);
    } else if (fall > 0) {
        from = std::max(from, (low_m_ - eye.z) / fall);
        to = std::min(to, (high_m_ - eye.z) / fall);
    } else if (eye.z < low_m_ || eye.z >= high_m_) {
        return;
    }
    // Nothing of this object is read in the loop: for all that a compiler knows, what is written to a cell changes it.
    const int last = layer_of(end.z);
    const float step = 1 / cells_per_m_, columns = static_cast<float>(width_), rows = static_cast<float>(height_);
    const float column_0 = (eye.x - static_cast<float>(origin_x_)) * cells_per_m_;
    const float row_0 = (eye.y - static_cast<float>(origin_y_)) * cells_per_m_;
    const float columns_per_m = dx / across * cells_per_m_, rows_per_m = dy / across * cells_per_m_;
    const float layers_0 = (eye.z - low_m_) * layers_per_m_, layers_per_m = fall * layers_per_m_;
    const std::size_t width = width_;
    const std::uint16_t look = look_;
    Cell* const cells = cells_.data();
    for (float at = from + 0.5F * step; at < to; at += step) {
        const float layers = layers_0 + layers_per_m * at;  // above the lowest
        const float column = column_0 + columns_per_m * at, row = row_0 + rows_per_m * at;
        if (!(layers >= 0 && column >= 0 && row >= 0 && column < columns && row < rows)) continue;
        const int below = std::min(static_cast<int>(layers), kLayers - 2), layer = 1 + below;
        if (layer == last && at > across - kGrazingGap_m) continue;
        Cell& cell = cells[static_cast<std::size_t>(static_cast<std::uint32_t>(row)) * width +
                           static_cast<std::uint32_t>(column)];
        renew(cell, look);
        if (cell.counts[layer] > 0) {
            const auto height =
                std::min(static_cast<unsigned>((layers - static_cast<float>(below)) * kSteps), kSteps - 1);
            const Span& span = cell.spans[layer];
            if (height + kMargin_steps < span.low || height > span.high + kMargin_steps) continue;
        }
        cell.seen = static_cast<std::uint8_t>(cell.seen | 1U << static_cast<unsigned>(layer));
    }
}

inline void OccupancyGrid::renew(Cell& cell, std::uint16_t look) noexcept {
    if (cell.look == look) return;
    count(cell);
    cell.look = look;
    cell.hit = cell.seen = 0;
}

void OccupancyGrid::count(Cell& cell) noexcept {
    const unsigned both = cell.hit | (cell.seen & ~kMoves);
    if (both == 0) return;
    const bool stands = (cell.hit & ~1U) != 0, moves = (cell.seen & kMoves) != 0;
    const int movers = cell.movers + (moves ? kMoverWeight : 0) - (stands ? kStandsWeight : 0);
    cell.movers = static_cast<std::uint8_t>(std::clamp(movers, 0, kMoversMax));
    for (unsigned left = both; left != 0; left &= left - 1) {
        const int layer = std::countr_zero(left);
        const int change = (cell.hit >> layer & 1U) != 0 ? kHitWeight : -kMissWeight;
        cell.counts[layer] = static_cast<std::int8_t>(std::clamp(cell.counts[layer] + change, kCountMin, kCountMax));
        if (cell.counts[layer] <= 0) cell.spans[layer] = Span{};
    }
}

void OccupancyGrid::finish() noexcept {
    for (Cell& cell : cells_.first(std::size_t{width_} * height_)) {
        count(cell);
        cell.hit = cell.seen = 0;
    }
}

GridCell OccupancyGrid::at(std::uint32_t x, std::uint32_t y) const noexcept {
    const Cell& cell = cells_[std::size_t{y} * width_ + x];
    if (!is_empty(cell)) {
        bool is_hit = false;
        for (int layer = 1; layer < kLayers; ++layer) is_hit = is_hit || cell.counts[layer] >= kOccupied;
        const bool stays = cell.last - cell.since >= static_cast<int>(kApart_moments) && cell.hits >= kHitsMin;
        return is_hit && stays && cell.movers <= kMovers && is_ridge(x, y) ? GridCell::kOccupied : GridCell::kUnknown;
    }
    return cell.counts[0] > 0 || cell.counts[1] < 0 || cell.counts[2] < 0 ? GridCell::kFree : GridCell::kUnknown;
}

bool OccupancyGrid::is_ridge(std::uint32_t x, std::uint32_t y) const noexcept {
    std::uint32_t most = 0;
    for (std::uint32_t row = y > 0 ? y - 1 : 0; row < std::min(y + 2, height_); ++row) {
        for (std::uint32_t column = x > 0 ? x - 1 : 0; column < std::min(x + 2, width_); ++column) {
            most = std::max<std::uint32_t>(most, cells_[std::size_t{row} * width_ + column].hits);
        }
    }
    return cells_[std::size_t{y} * width_ + x].hits * 100U >= most * kNoise_percent;
}

bool OccupancyGrid::stands(double x, double y, double z) const noexcept {
    const int layer = layer_of(static_cast<float>(z));
    if (layer < 1) return true;
    const double column = (x - origin_x_) / options_.resolution_m, row = (y - origin_y_) / options_.resolution_m;
    if (!(column >= 0 && row >= 0 && column < width_ && row < height_)) return true;
    return cells_[static_cast<std::size_t>(row) * width_ + static_cast<std::size_t>(column)].counts[layer] >= kOccupied;
}

}  // namespace stillmesh
