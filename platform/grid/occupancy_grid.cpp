#include "platform/grid/occupancy_grid.hpp"

#include <algorithm>
#include <bit>
#include <cmath>
#include <cstring>

#include "engine/base/check.hpp"

namespace stillmesh {
namespace {

constexpr std::uint32_t kRayStride = 2;  // cells of a depth image, of rays; surfaces are taken from all
constexpr std::uint64_t kHitWeight = 2;  // of a surface; of a ray that went through: 1
// Nothing was seen, and the most: bits say whether a count of 0 to 7 is above 3, and of 8 or 9 that it was too much.
constexpr std::uint8_t kCountZero = 3, kCountTop = 7;
constexpr std::uint8_t kHit = kCountZero + 3;  // surfaces of two images
constexpr float kEndGap_m = 0.1F;              // rays say nothing of it
constexpr float kGrazingGap_m = 0.4F;          // nor of this in the layer where they end
constexpr float kFloorDeep_m = 0.3F;           // what lies lower is no floor
constexpr float kJoined_m = 0.3F;  // so far apart two cells of an image, one above the other, show one level surface
constexpr float kJoinedStep_m = 0.03F;
constexpr unsigned kSteps = 16;                             // of a layer
constexpr unsigned kMargin_steps = 4;                       // beyond a surface: a flat one is crossed by few rays
constexpr unsigned kMoment_frames = 5, kApart_moments = 3;  // half a second between first and last, as a rule
constexpr std::size_t kNowhere = ~std::size_t{0};
constexpr unsigned kFloor = 1;  // its bit
constexpr unsigned kMoves = 1;  // the floor's bit of what was seen
// Above: nothing stands there. Of a scene in which people sit at desks one cell in 860 is lost by it, of one in which
// they walk none; six looks bring back what was put where they walked.
constexpr int kMovers = 8, kMoversMax = 16, kMoverWeight = 1, kStandsWeight = 2;
constexpr unsigned kHitsMin = 4;         // fewer pixels of an image are no obstacle
constexpr unsigned kNoise_percent = 15;  // hit less often than the cell beside it by so much: noise of that

constexpr float kCellsFar = 1e6F;  // farther out than any grid

// With 32 bits behind the point: of a step's direction a ray loses nothing to be seen.
std::int64_t fixed(float value) noexcept {
    return static_cast<std::int64_t>(value * 4294967296.0F);
}

constexpr std::uint64_t kOnes = 0x0101010101010101U;

// Bit i of eight as byte i, and back.
std::uint64_t bytes_of(unsigned bits) noexcept {
    const std::uint64_t apart = bits * kOnes & 0x8040201008040201U;
    return (apart + 0x7F7F7F7F7F7F7F7FU) >> 7U & kOnes;
}
unsigned bits_of(std::uint64_t bytes) noexcept {
    return static_cast<unsigned>(bytes * 0x0102040810204080U >> 56U);
}

}  // namespace

void OccupancyGrid::create(std::span<std::byte> block, const GridOptions& options) noexcept {
    STILLMESH_CHECK(block.size() >= bytes(options));
    options_ = options;
    const std::size_t cells = options.cells_max;
    cells_ = {reinterpret_cast<Cell*>(block.data()), cells};
    auto* const bytes_after = reinterpret_cast<std::uint8_t*>(block.data() + cells * sizeof(Cell));
    hit_ = {bytes_after, cells};
    seen_ = {bytes_after + cells, cells};
    surface_ = {bytes_after + 2 * cells, cells};
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
    is_first_ = true;
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
    const std::size_t cells = std::size_t{width_} * height_;
    Cell fresh;
    fresh.counts = kOnes * kCountZero;
    std::fill_n(cells_.begin(), cells, fresh);
    for (const std::span<std::uint8_t> bits : {hit_, seen_, surface_}) std::fill_n(bits.begin(), cells, 0);
}

inline std::size_t OccupancyGrid::cell_at(float x, float y) const noexcept {
    const float column = (x - static_cast<float>(origin_x_)) * cells_per_m_;
    const float row = (y - static_cast<float>(origin_y_)) * cells_per_m_;
    if (!(column >= 0 && row >= 0 && column < static_cast<float>(width_) && row < static_cast<float>(height_))) {
        return kNowhere;
    }
    return static_cast<std::size_t>(static_cast<std::uint32_t>(row)) * width_ + static_cast<std::uint32_t>(column);
}

// 0: the floor; -1: none.
inline int OccupancyGrid::layer_of(float z) const noexcept {
    if (z < -kFloorDeep_m || z >= high_m_) return -1;
    return z < low_m_ ? 0 : std::min(1 + static_cast<int>((z - low_m_) * layers_per_m_), kLayers - 1);
}

void OccupancyGrid::add(const DepthImage& depth, const RigidTransform& level_from_camera) noexcept {
    if (width_ == 0) return;
    if (is_first_) first_frame_ = depth.frame;
    const std::uint64_t moment = std::min<std::uint64_t>((depth.frame - first_frame_) / kMoment_frames, 65535);
    if (!is_first_ && moment != moment_) count_look();
    is_first_ = false;
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
                if (p.z >= low_m_ && p.z < high_m_ && row + 1 < depth.rows && depth.is_still(below))
                    join(p, point_of(depth, below, eye));
            }
            if (row % kRayStride == 0 && column % kRayStride == 0) look_through(eye.at, p);
        }
    }
}

inline unsigned OccupancyGrid::step_of(float z, int layer) const noexcept {
    const float above = (z - low_m_) * layers_per_m_ - static_cast<float>(layer - 1);
    return static_cast<unsigned>(std::clamp(above * kSteps, 0.0F, kSteps - 1.0F));
}

inline void OccupancyGrid::hit(const Point& p) noexcept {
    const int layer = layer_of(p.z);
    const std::size_t at = layer < 0 ? kNowhere : cell_at(p.x, p.y);
    if (at == kNowhere) return;
    const unsigned before = hit_[at];
    hit_[at] = static_cast<std::uint8_t>(before | 1U << static_cast<unsigned>(layer));
    if (layer == 0) return;
    Cell& cell = cells_[at];
    if (cell.hits < 65535) ++cell.hits;
    // The first of this moment above the floor, and nothing was there.
    if (((before | surface_[at]) & ~kFloor) == 0) cell.since = moment_;
    cell.last = moment_;
    Span& span = cell.spans[layer];
    const unsigned step = step_of(p.z, layer);
    if (step < span.low) span.low = step & 15U;
    if (step > span.high) span.high = step & 15U;
}

// What moves stands on no obstacle: whatever was seen there was it, or went before it came.
void OccupancyGrid::leave(const Point& p) noexcept {
    const int layer = layer_of(p.z);
    const std::size_t at = layer < 1 ? kNowhere : cell_at(p.x, p.y);
    if (at != kNowhere) seen_[at] = static_cast<std::uint8_t>(seen_[at] | kMoves | 1U << static_cast<unsigned>(layer));
}

// A level surface seen at a flat angle is hit here and there: what lies between two of its cells is part of it.
inline void OccupancyGrid::join(const Point& a, const Point& b) noexcept {
    const float dx = b.x - a.x, dy = b.y - a.y, dz = b.z - a.z;
    if (std::abs(dz) > kJoinedStep_m) return;
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
    const float step = 1 / cells_per_m_, first = from + 0.5F * step;
    if (!(first < to)) return;
    const auto steps_to = [&](float at) { return at < first ? 0 : 1 + static_cast<int>((at - first) * cells_per_m_); };
    const float column = (eye.x - static_cast<float>(origin_x_) + dx / across * first) * cells_per_m_;
    const float row = (eye.y - static_cast<float>(origin_y_) + dy / across * first) * cells_per_m_;
    if (!(std::abs(column) < kCellsFar && std::abs(row) < kCellsFar)) return;
    Ray ray;
    ray.at = {fixed(column), fixed(row), fixed((eye.z - low_m_ + fall * first) * layers_per_m_)};
    ray.step = {fixed(dx / across), fixed(dy / across), fixed(fall * layers_per_m_ * step)};
    const int steps = steps_to(to), clear = std::min(steps, steps_to(across - kGrazingGap_m));
    march(ray, clear, -1);
    march(ray, steps - clear, layer_of(end.z));
}

inline bool OccupancyGrid::is_inside(const Ray::Place& at) const noexcept {
    return at.layer >= 0 && at.layer >> 32 < kLayers - 1 && at.column >= 0 && at.column >> 32 < width_ && at.row >= 0 &&
           at.row >> 32 < height_;
}

// What lies in layer `but` says nothing. A ray is inside all the way, once it is, until it has left.
void OccupancyGrid::march(Ray& ray, int steps, int but) noexcept {
    Ray::Place at = ray.at;
    const Ray::Place step = ray.step;
    ray.at = at + step * steps;
    for (; steps > 0 && !is_inside(at); --steps) at = at + step;
    for (Ray::Place last = at + step * (steps - 1); steps > 0 && !is_inside(last); --steps) last = last + step * -1;
    const Cell* const cells = cells_.data();
    const std::uint8_t* const surface = surface_.data();
    std::uint8_t* const seen = seen_.data();
    const std::size_t width = width_;
    for (; steps > 0; --steps, at = at + step) {
        const auto layer = static_cast<std::uint32_t>(at.layer >> 32) + 1;
        if (static_cast<int>(layer) == but) continue;
        const std::size_t cell =
            static_cast<std::uint32_t>(at.row >> 32) * width + static_cast<std::uint32_t>(at.column >> 32);
        if ((surface[cell] >> layer & 1U) != 0) {
            const unsigned height = static_cast<std::uint32_t>(at.layer) / (0xFFFFFFFFU / kSteps + 1);
            const Span& span = cells[cell].spans[layer];
            if (height + kMargin_steps < span.low || height > span.high + kMargin_steps) continue;
        }
        seen[cell] = static_cast<std::uint8_t>(seen[cell] | 1U << layer);
    }
}

// Of the moment that ended. Eight cells at once: most were not looked at.
void OccupancyGrid::count_look() noexcept {
    const std::size_t cells = std::size_t{width_} * height_;
    std::size_t at = 0;
    for (; at + 8 <= cells; at += 8) {
        std::uint64_t hit = 0, seen = 0;
        std::memcpy(&hit, &hit_[at], 8);
        std::memcpy(&seen, &seen_[at], 8);
        if ((hit | seen) == 0) continue;
        for (std::size_t i = at; i < at + 8; ++i) count(i);
    }
    for (; at < cells; ++at) count(at);
    std::fill_n(hit_.begin(), cells, 0);
    std::fill_n(seen_.begin(), cells, 0);
}

// All layers at once, a byte each: of a count, up to kCountTop, no bit runs over into the next.
inline void OccupancyGrid::count(std::size_t at) noexcept {
    const unsigned hit = hit_[at], seen = seen_[at], through = seen & ~hit & ~kMoves;
    if ((hit | through) == 0) return;
    Cell& cell = cells_[at];
    const bool stands = (hit & ~kFloor) != 0, moves = (seen & kMoves) != 0;
    const int movers = cell.movers + (moves ? kMoverWeight : 0) - (stands ? kStandsWeight : 0);
    cell.movers = static_cast<std::uint8_t>(std::clamp(movers, 0, kMoversMax));
    std::uint64_t counts = cell.counts;
    const std::uint64_t not_zero = (counts + kOnes * kCountTop) >> 3U & kOnes;
    counts -= bytes_of(through) & not_zero;
    counts += bytes_of(hit) * kHitWeight;
    counts = (counts | (counts >> 3U & kOnes) * kCountTop) & kOnes * kCountTop;
    cell.counts = counts;
    const unsigned surface = bits_of(counts >> 2U & kOnes);  // more than kCountZero
    for (unsigned left = (hit | surface_[at]) & ~surface; left != 0; left &= left - 1) {
        cell.spans[std::countr_zero(left)] = Span{};
    }
    surface_[at] = static_cast<std::uint8_t>(surface);
}

void OccupancyGrid::finish() noexcept {
    count_look();
}

GridCell OccupancyGrid::at(std::uint32_t x, std::uint32_t y) const noexcept {
    const std::size_t at = std::size_t{y} * width_ + x;
    const Cell& cell = cells_[at];
    if ((surface_[at] & ~kFloor) != 0) {
        bool is_hit = false;
        for (int layer = 1; layer < kLayers; ++layer) is_hit = is_hit || count_of(cell, layer) >= kHit;
        const bool stays = cell.last - cell.since >= static_cast<int>(kApart_moments) && cell.hits >= kHitsMin;
        return is_hit && stays && cell.movers <= kMovers && is_ridge(x, y) ? GridCell::kOccupied : GridCell::kUnknown;
    }
    const bool is_seen_free = count_of(cell, 1) < kCountZero || count_of(cell, 2) < kCountZero;
    return (surface_[at] & kFloor) != 0 || is_seen_free ? GridCell::kFree : GridCell::kUnknown;
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
    return count_of(cells_[static_cast<std::size_t>(row) * width_ + static_cast<std::size_t>(column)], layer) >= kHit;
}

}  // namespace stillmesh
