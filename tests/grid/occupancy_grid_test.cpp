#include "platform/grid/occupancy_grid.hpp"

#include <gtest/gtest.h>

#include <cmath>
#include <cstdint>
#include <vector>

#include "tests/grid/synthetic_room.hpp"
#include "tests/support/heap_calls.hpp"

namespace stillmesh::occupancy_grid_test {
namespace {

using test::camera_at;
using test::RoomBox;
using test::SeenRoom;

struct Look {
    std::vector<std::uint16_t> depth_mm;
    RigidTransform level_from_camera;
    std::uint64_t after = 15;  // frames since the one before
};

// A grid of looks at rooms, half a second from one to the next; coordinates of the room are level ones.
class Grid {
public:
    explicit Grid(const GridOptions& options = {}) : block_(OccupancyGrid::bytes(options)) {
        grid_.create(block_, options);
    }
    void build(SeenRoom& room, const std::vector<Look>& looks) {
        grid_.begin();
        for (const Look& look : looks) grid_.cover(room.image(look.depth_mm), look.level_from_camera);
        grid_.lay_out();
        std::uint64_t frame = 100;
        for (const Look& look : looks)
            grid_.add(room.image(look.depth_mm, frame += look.after), look.level_from_camera);
        grid_.finish();
    }
    [[nodiscard]] GridCell at(double x, double y) const {
        const double column = std::floor((x - grid_.origin_x()) / grid_.options().resolution_m);
        const double row = std::floor((y - grid_.origin_y()) / grid_.options().resolution_m);
        if (column < 0 || row < 0 || column >= grid_.width() || row >= grid_.height()) return GridCell::kUnknown;
        return grid_.at(static_cast<std::uint32_t>(column), static_cast<std::uint32_t>(row));
    }
    // How many cells of a rectangle are so.
    [[nodiscard]] int count(GridCell what, double x0, double x1, double y0, double y1) const {
        int count = 0;
        for (double x = x0 + 0.025; x < x1; x += 0.05) {
            for (double y = y0 + 0.025; y < y1; y += 0.05) count += at(x, y) == what ? 1 : 0;
        }
        return count;
    }
    [[nodiscard]] const OccupancyGrid& operator*() const { return grid_; }

private:
    std::vector<std::byte> block_;
    OccupancyGrid grid_;
};

// From some places beside each other, 1.2 m high.
std::vector<Look> looks_at(SeenRoom& room, int count, double from_y = -0.3) {
    std::vector<Look> looks;
    for (int i = 0; i < count; ++i) {
        const RigidTransform camera = camera_at({0.02 * i, from_y + 0.05 * i, 1.2}, 0, 0.35);
        looks.push_back({room.look(camera), camera});
    }
    return looks;
}
void append(std::vector<Look>& to, const std::vector<Look>& more) {
    to.insert(to.end(), more.begin(), more.end());
}

constexpr RoomBox kWall{3.5, 3.7, -4, 4, 0, 2.5};
constexpr RoomBox kCrate{2.0, 2.4, -0.3, 0.3, 0, 0.5};

// Promise: what stands is occupied, seen floor is free, and what lies behind or beside the view is unknown.
TEST(OccupancyGrid, SaysWhatIsFreeOccupiedAndUnknown) {
    SeenRoom room;
    room.boxes = {kWall, kCrate};
    Grid grid;
    grid.build(room, looks_at(room, 8));
    EXPECT_GE(grid.count(GridCell::kOccupied, 2.0, 2.05, -0.3, 0.3), 11);
    EXPECT_GE(grid.count(GridCell::kOccupied, 3.5, 3.55, -1, 1), 35);
    EXPECT_EQ(grid.count(GridCell::kOccupied, 0.8, 1.9, -0.3, 0.3), 0);
    EXPECT_GE(grid.count(GridCell::kFree, 1.2, 1.9, -0.3, 0.3), 160);
    EXPECT_EQ(grid.at(3.9, 0), GridCell::kUnknown);
    EXPECT_EQ(grid.at(-1, 0), GridCell::kUnknown);
    EXPECT_EQ(grid.count(GridCell::kFree, 2.05, 2.4, -0.25, 0.25), 0);
}

// Promise: a table top is in the way although floor is seen under it and the wall over it, however flat the look.
TEST(OccupancyGrid, ATableIsInTheWay) {
    SeenRoom room;
    room.noise = 0.0014;
    room.boxes = {kWall, {1.6, 2.4, -0.5, 0.5, 0.70, 0.74}};
    Grid grid;
    grid.build(room, looks_at(room, 12));
    const int inside = 16 * 20;
    EXPECT_GE(grid.count(GridCell::kOccupied, 1.6, 2.4, -0.5, 0.5), inside * 9 / 10);
    EXPECT_LE(grid.count(GridCell::kFree, 1.65, 2.35, -0.45, 0.45), inside / 50);
}

// Promise: what is higher than the robot, or lower than an obstacle, is not in the way; the two heights say so.
TEST(OccupancyGrid, HeightsAreThoseOfTheRobot) {
    SeenRoom room;
    room.boxes = {kWall, {1.6, 1.9, -0.2, 0.2, 0.9, 1.1}, {1.3, 1.5, 0.4, 0.6, 0, 0.06}};
    const std::vector<Look> looks = looks_at(room, 8);
    GridOptions low;
    low.robot_m = 0.8;
    Grid low_robot(low), tall_robot;
    low_robot.build(room, looks);
    tall_robot.build(room, looks);
    EXPECT_EQ(low_robot.count(GridCell::kOccupied, 1.5, 2.0, -0.3, 0.3), 0);
    EXPECT_GT(tall_robot.count(GridCell::kOccupied, 1.5, 2.0, -0.3, 0.3), 6);
    EXPECT_EQ(tall_robot.count(GridCell::kOccupied, 1.2, 1.6, 0.35, 0.65), 0);
    GridOptions flat;
    flat.obstacle_m = 0.03;
    Grid careful(flat);
    careful.build(room, looks);
    EXPECT_GT(careful.count(GridCell::kOccupied, 1.2, 1.6, 0.35, 0.65), 6);
}

// Promise: furniture that was moved has left its place after six looks, and is at the new one after two.
TEST(OccupancyGrid, WhatWasMovedLeavesItsPlace) {
    SeenRoom before, after;
    before.boxes = {kWall, kCrate};
    after.boxes = {kWall, {2.0, 2.4, -1.1, -0.5, 0, 0.5}};
    std::vector<Look> looks = looks_at(before, 20);
    append(looks, looks_at(after, 8));
    Grid grid;
    grid.build(after, looks);
    EXPECT_EQ(grid.count(GridCell::kOccupied, 1.95, 2.45, -0.3, 0.35), 0);
    EXPECT_GE(grid.count(GridCell::kOccupied, 2.0, 2.05, -1.0, -0.6), 7);
}

// Promise: somebody who crosses the view is in the way at no time; who stops is, until looks go through his place.
TEST(OccupancyGrid, WhoeverWalksIsNoPartOfIt) {
    SeenRoom empty, room;
    empty.boxes = {kWall};
    std::vector<Look> looks = looks_at(empty, 3);
    for (int step = 0; step < 6; ++step) {
        const double y = -0.9 + 0.3 * step;
        room.boxes = {kWall, {1.8, 2.1, y, y + 0.25, 0, 1.8}};
        append(looks, looks_at(room, 1));
    }
    Grid grid;
    grid.build(empty, looks);
    EXPECT_EQ(grid.count(GridCell::kOccupied, 1.0, 2.5, -1.0, 1.2), 0);
    append(looks, looks_at(room, 4));
    grid.build(empty, looks);
    EXPECT_GT(grid.count(GridCell::kOccupied, 1.75, 1.9, 0.6, 0.85), 4);
    append(looks, looks_at(empty, 6));
    grid.build(empty, looks);
    EXPECT_EQ(grid.count(GridCell::kOccupied, 1.0, 2.5, -1.0, 1.2), 0);
}

// Promise: what is known to move is nowhere in the way, and what was seen in its place before has gone, although no ray
// goes through.
TEST(OccupancyGrid, WhereSomethingMovesNothingStands) {
    SeenRoom empty, room;
    empty.boxes = {kWall};
    room.boxes = {kWall, {1.8, 2.1, -0.2, 0.2, 0, 1.8}};
    const auto moving_at = [&](int count) {
        std::vector<Look> looks = looks_at(room, count);
        const std::vector<Look> behind = looks_at(empty, count);
        for (std::size_t i = 0; i < looks.size(); ++i) {
            for (std::size_t cell = 0; cell < looks[i].depth_mm.size(); ++cell) {
                if (looks[i].depth_mm[cell] != behind[i].depth_mm[cell]) looks[i].depth_mm[cell] |= DepthImage::kMoving;
            }
        }
        return looks;
    };
    Grid grid;
    grid.build(room, moving_at(8));
    EXPECT_EQ(grid.count(GridCell::kOccupied, 1.0, 2.5, -1.0, 1.0), 0);
    std::vector<Look> looks = looks_at(room, 8);
    grid.build(room, looks);
    EXPECT_GT(grid.count(GridCell::kOccupied, 1.75, 1.9, -0.2, 0.2), 4);
    append(looks, moving_at(8));
    grid.build(room, looks);
    EXPECT_EQ(grid.count(GridCell::kOccupied, 1.0, 2.5, -1.0, 1.0), 0);
}

// Promise: where something that moves was seen again and again, a few looks that take it for standing make no obstacle
// of it; what is put there and stays is one after six.
TEST(OccupancyGrid, WhereSomethingMovedOftenAFewLooksAreNoProof) {
    SeenRoom room;
    room.boxes = {kWall, kCrate};
    const std::vector<Look> standing = looks_at(room, 6);
    std::vector<Look> looks = looks_at(room, 20, -0.6);
    for (Look& look : looks) {
        for (std::uint16_t& mm : look.depth_mm) {
            if (mm > 0 && mm < 2600) mm |= DepthImage::kMoving;
        }
    }
    Grid grid;
    grid.build(room, {standing.begin(), standing.begin() + 2});
    EXPECT_GE(grid.count(GridCell::kOccupied, 2.0, 2.05, -0.3, 0.3), 11) << "two looks alone are enough";
    for (std::size_t i = 0; i < 6; ++i) {
        looks.push_back(standing[i]);
        grid.build(room, looks);
        const int occupied = grid.count(GridCell::kOccupied, 2.0, 2.05, -0.3, 0.3);
        EXPECT_TRUE(i < 3 ? occupied == 0 : i < 5 || occupied >= 11) << occupied << " after " << i + 1;
    }
}

// Promise: images of one moment count as one: three at once, and one later, with three looks through in between, are as
// little of an obstacle as one and one; three that lie apart are one.
TEST(OccupancyGrid, ImagesOfOneMomentAreOneLook) {
    SeenRoom room;
    room.boxes = {kWall, kCrate};
    const std::vector<Look> standing = looks_at(room, 4);
    room.boxes = {kWall};
    const std::vector<Look> empty = looks_at(room, 3);
    for (const bool is_at_once : {true, false}) {
        std::vector<Look> looks = {standing[0], standing[1], standing[2], empty[0], empty[1], empty[2], standing[3]};
        if (is_at_once) looks[1].after = looks[2].after = 1;
        Grid grid;
        grid.build(room, looks);
        const int occupied = grid.count(GridCell::kOccupied, 2.0, 2.05, -0.3, 0.3);
        EXPECT_TRUE(is_at_once ? occupied == 0 : occupied >= 11) << occupied << " at once " << is_at_once;
    }
}

// Promise: an area larger than there is room for is cut about its middle, and said; no byte behind the block is touched
// and the heap is not asked.
TEST(OccupancyGrid, TooLargeAnAreaIsCut) {
    GridOptions options;
    options.cells_max = 1000;
    const std::size_t size = OccupancyGrid::bytes(options);
    std::vector<std::byte> block(size + 64, std::byte{0x5a});
    OccupancyGrid grid;
    grid.create(std::span(block).first(size), options);
    SeenRoom room;
    room.boxes = {kWall};
    const std::vector<Look> looks = looks_at(room, 3);
    const std::uint64_t before = test::heap_calls();
    grid.begin();
    for (const Look& look : looks) grid.cover(room.image(look.depth_mm), look.level_from_camera);
    grid.lay_out();
    for (const Look& look : looks) grid.add(room.image(look.depth_mm), look.level_from_camera);
    grid.finish();
    EXPECT_EQ(test::heap_calls(), before);
    EXPECT_TRUE(grid.is_cut());
    EXPECT_LE(grid.width() * grid.height(), 1000U);
    EXPECT_GE(grid.width() * grid.height(), 900U);
    for (std::size_t i = size; i < block.size(); ++i) EXPECT_EQ(block[i], std::byte{0x5a});
}

// Promise: nothing seen is no grid.
TEST(OccupancyGrid, NothingIsNothing) {
    SeenRoom room;
    room.has_floor = false;
    Grid grid;
    grid.build(room, looks_at(room, 2));
    EXPECT_EQ((*grid).width(), 0U);
}

}  // namespace
}  // namespace stillmesh::occupancy_grid_test
