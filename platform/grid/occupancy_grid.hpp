// Where a robot can drive: cells seen empty, occupied or never seen, from the depth images of keyframes in time order.
// Between the floor and the robot's height space is cut into layers; in each a cell counts what an image showed there:
// a surface, or a ray that went through. Both weigh the same and neither is counted far, so that furniture that was
// moved leaves its place after a few looks, and people before they are map. Occupied is a cell with a surface in one
// layer, seen in images that lie some time apart: what walks is elsewhere by then. Free is one whose floor, or the
// space right above it, was seen, and no surface. Where one image shows both, a surface wins; rays say nothing of their
// last piece, where they graze what they end on. A cell that was hit far less often than one beside it is the noise of
// that one. Images of one moment are right or wrong together and count as one. Where something that moves was seen far
// more often than what stands, nothing stands: of who stops for a while not every image is known to be of him. Limits:
// cells_max; what lies farther out than they reach is left out. Memory: bytes(), given once, no heap. Cost: measured in
// docs/grid.md.
#pragma once

#include <cstddef>
#include <cstdint>
#include <span>

#include "engine/geometry/rigid_transform.hpp"
#include "engine/outputs.hpp"

namespace stillmesh {

struct GridOptions {
    double resolution_m = 0.05;         // side of a cell
    double obstacle_m = 0.08;           // what rises higher above the floor is in the way
    double robot_m = 1.2;               // what begins higher is not
    double range_m = 5.0;               // farther is not looked at
    std::uint32_t cells_max = 400'000;  // 31 x 31 m of .05
};

enum class GridCell : std::uint8_t { kUnknown, kFree, kOccupied };

class OccupancyGrid {
public:
    [[nodiscard]] static std::size_t bytes(const GridOptions& options) noexcept {
        return std::size_t{options.cells_max} * (sizeof(Cell) + 3 * sizeof(std::uint8_t));
    }
    // `block`: bytes(options), aligned to 8; outlives it.
    void create(std::span<std::byte> block, const GridOptions& options) noexcept;

    // First pass: how far the grid reaches. Second: what each keyframe saw, oldest first.
    void begin() noexcept;
    void cover(const DepthImage& depth, const RigidTransform& level_from_camera) noexcept;
    void lay_out() noexcept;
    void add(const DepthImage& depth, const RigidTransform& level_from_camera) noexcept;
    // Counts what add() left; then the cells are valid until begin().
    void finish() noexcept;

    [[nodiscard]] const GridOptions& options() const noexcept { return options_; }
    [[nodiscard]] std::uint32_t width() const noexcept { return width_; }
    [[nodiscard]] std::uint32_t height() const noexcept { return height_; }
    // Of the lower left corner, m.
    [[nodiscard]] double origin_x() const noexcept { return origin_x_; }
    [[nodiscard]] double origin_y() const noexcept { return origin_y_; }
    [[nodiscard]] GridCell at(std::uint32_t x, std::uint32_t y) const noexcept;
    // Whether a point, level, is part of what stands there still: false where later looks went through.
    [[nodiscard]] bool stands(double x, double y, double z) const noexcept;
    [[nodiscard]] bool is_cut() const noexcept { return is_cut_; }

private:
    static constexpr int kLayers = 8;  // the first: the floor
    // Of a surface in a layer: from the lowest of 16 steps to the highest. A ray above a table is no word on the table.
    struct Span {
        std::uint8_t low : 4 = 15, high : 4 = 0;
    };
    struct Cell {
        std::uint64_t counts = 0;  // a byte per layer
        Span spans[kLayers];
        std::uint8_t movers = 0;            // looks that showed something that moves, less what showed what stands
        std::uint16_t hits = 0;             // of surfaces above the floor, all in all
        std::uint16_t since = 0, last = 0;  // when they were hit since nothing was there, in moments
    };
    struct Point {
        float x = 0, y = 0, z = 0;
    };
    // A keyframe's camera, level.
    struct Eye {
        float r[9] = {};
        Point at;
    };

    [[nodiscard]] static unsigned count_of(const Cell& cell, int layer) noexcept {
        return static_cast<unsigned>(cell.counts >> 8 * layer & 0xFFU);
    }

    // A way through the grid in fixed point: cells and layers, 32 bits behind the point.
    struct Ray {
        struct Place {
            std::int64_t column = 0, row = 0, layer = 0;
            Place operator+(const Place& b) const noexcept { return {column + b.column, row + b.row, layer + b.layer}; }
            Place operator*(int times) const noexcept { return {column * times, row * times, layer * times}; }
        };
        Place at, step;
    };

    [[nodiscard]] static Eye eye_of(const RigidTransform& level_from_camera) noexcept;
    [[nodiscard]] static Point point_of(const DepthImage& depth, std::size_t cell, const Eye& eye) noexcept;
    // kNowhere: outside.
    [[nodiscard]] std::size_t cell_at(float x, float y) const noexcept;
    [[nodiscard]] int layer_of(float z) const noexcept;
    [[nodiscard]] unsigned step_of(float z, int layer) const noexcept;
    void hit(const Point& p) noexcept;
    void leave(const Point& p) noexcept;
    void join(const Point& a, const Point& b) noexcept;
    void look_through(const Point& eye, const Point& end) noexcept;
    [[nodiscard]] bool is_inside(const Ray::Place& at) const noexcept;
    void march(Ray& ray, int steps, int but) noexcept;
    [[nodiscard]] bool is_ridge(std::uint32_t x, std::uint32_t y) const noexcept;
    void count_look() noexcept;
    void count(std::size_t at) noexcept;

    GridOptions options_;
    std::span<Cell> cells_;
    // A byte per cell, a bit per layer. Apart from the cells: rays touch these alone, as a rule, and they fit in a
    // first cache. What this moment shows, hit and seen through (of that the first bit: something moves there), and
    // where a surface is after all moments before.
    std::span<std::uint8_t> hit_, seen_, surface_;
    float low_m_ = 0, high_m_ = 0, layers_per_m_ = 0, cells_per_m_ = 0;
    float x_min_ = 0, x_max_ = 0, y_min_ = 0, y_max_ = 0;  // of what was covered
    double origin_x_ = 0, origin_y_ = 0;
    std::uint32_t width_ = 0, height_ = 0;
    std::uint64_t first_frame_ = 0;
    std::uint16_t moment_ = 0;  // of the image at hand
    bool is_first_ = true, is_cut_ = false;
};

}  // namespace stillmesh
