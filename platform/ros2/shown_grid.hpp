// A grid to drive in, on its way from the engine's thread to whoever shows it: nobody waits, the newest wins, and what
// says the same as the one before is not shown again. Memory: a byte a cell three times, taken by open().
#pragma once

#include <cmath>
#include <cstdint>
#include <mutex>
#include <utility>
#include <vector>

#include "engine/geometry/rigid_transform.hpp"

namespace stillmesh {

struct ShownGrid {
    static constexpr std::int8_t kUnknown = -1, kFree = 0, kOccupied = 100;  // as nav_msgs/OccupancyGrid has them

    std::uint32_t width = 0, height = 0;
    double resolution_m = 0;
    RigidTransform map_from_grid;    // the engine's map from the first cell's corner, x along a row, z up
    std::vector<std::int8_t> cells;  // row by row
};

class GridShelf {
public:
    // `frame_from_map`: whose axes the grid is to have, as far as the floor allows.
    explicit GridShelf(const RigidTransform& frame_from_map) : frame_from_map_(frame_from_map) {}

    void open(std::size_t cells_max) {
        for (ShownGrid* const grid : {&draft_, &ready_, &shown_}) grid->cells.reserve(cells_max);
    }
    [[nodiscard]] const RigidTransform& frame_from_map() const { return frame_from_map_; }

    // --- the engine's thread: the next one is written here, then handed over.
    [[nodiscard]] ShownGrid& draft() { return draft_; }
    void hand_over() {
        const std::lock_guard lock(mutex_);
        std::swap(draft_, ready_);
        is_new_ = true;
    }
    // --- who shows it: one that says something new; nullptr: there is none. Valid until the next call.
    [[nodiscard]] const ShownGrid* take() {
        const std::lock_guard lock(mutex_);
        if (!std::exchange(is_new_, false) || is_same(ready_, shown_)) return nullptr;
        std::swap(ready_, shown_);
        return &shown_;
    }

private:
    [[nodiscard]] static bool is_same(const ShownGrid& a, const ShownGrid& b) {
        constexpr double kMoved_m = 0.001, kTurned = 0.0005;  // far below what a cell can tell
        for (int i = 0; i < 3; ++i) {
            const double moved = a.map_from_grid.translation_m[i] - b.map_from_grid.translation_m[i];
            if (std::abs(moved) > kMoved_m) return false;
        }
        for (int i = 0; i < 4; ++i) {
            const double turned = a.map_from_grid.rotation_xyzw[i] - b.map_from_grid.rotation_xyzw[i];
            if (std::abs(turned) > kTurned) return false;
        }
        return a.width == b.width && a.height == b.height && a.cells == b.cells;
    }

    RigidTransform frame_from_map_;
    ShownGrid draft_;
    std::mutex mutex_;  // of the two behind it
    ShownGrid ready_;
    bool is_new_ = false;
    ShownGrid shown_;
};

}  // namespace stillmesh
