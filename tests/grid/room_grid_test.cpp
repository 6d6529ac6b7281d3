// Floor and grid of whole simulated rooms, as the engine tracked them, against what the renderer drew.
#include <gtest/gtest.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <cstdint>
#include <cstdio>

#include "tests/grid/tracked_room.hpp"

namespace stillmesh::room_grid_test {
namespace {

using test::Score;
using test::score_of;
using test::TrackedRoom;

class RoomFloor : public ::testing::TestWithParam<const char*> {};

// Promise: in every scene that sees a tenth of floor it is found, within 1 degree and 2 cm; where less is seen it is
// right or unknown.
TEST_P(RoomFloor, IsTrueOrUnknown) {
    const TrackedRoom room(GetParam(), 1, {.frames = 150});
    const Floor& floor = room.job().floor();
    EXPECT_TRUE(floor.is_known || room.true_floor_share() < 0.1);
    if (!floor.is_known) return;
    const RigidTransform world_from_level = room.world_from_level();
    EXPECT_LT(std::acos(std::min(1.0, rotated(world_from_level, {0, 0, 1})[2])), 3.14159265 / 180);
    EXPECT_LT(std::abs(transformed(world_from_level, {0, 0, 0})[2]), 0.02);
}
INSTANTIATE_TEST_SUITE_P(Scenes, RoomFloor,
                         ::testing::Values("static_xyz", "static_rpy", "static_halfsphere", "walking_halfsphere",
                                           "sitting_rpy", "trolley_xyz", "crowd_close", "lift", "corridor",
                                           "real_walking_rpy"));

// Promise: furniture that was moved is where it is now, and not where it was: 340 cells hold armchair and crate, or
// did; what the crate hides of the way it came may be left.
TEST(RoomGrid, FurnitureIsAtItsNewPlace) {
    const TrackedRoom room("rearranged", 1, {.frames = 600});
    ASSERT_TRUE(room.job().has_grid());
    const Score score = score_of(room);
    EXPECT_GE(score.share(), 0.97) << score.right << " of " << score.seen;
    EXPECT_LE(score.ghosts, 10);
}

// Share of what one grid knows that another knows too, within a cell.
double covered_share(const TrackedRoom& room, const TrackedRoom& by) {
    const OccupancyGrid& grid = room.job().grid();
    const OccupancyGrid& other = by.job().grid();
    const double side = grid.options().resolution_m;
    const RigidTransform there_from_here = compose(inverse_of(by.world_from_level()), room.world_from_level());
    int known = 0, covered = 0;
    for (std::uint32_t row = 0; row < grid.height(); ++row) {
        for (std::uint32_t column = 0; column < grid.width(); ++column) {
            if (grid.at(column, row) == GridCell::kUnknown) continue;
            const std::array<double, 3> p = transformed(
                there_from_here, {grid.origin_x() + (column + 0.5) * side, grid.origin_y() + (row + 0.5) * side, 0});
            const auto x = static_cast<int>(std::floor((p[0] - other.origin_x()) / side));
            const auto y = static_cast<int>(std::floor((p[1] - other.origin_y()) / side));
            const auto is_known = [&](int dx, int dy) {
                const int there_x = x + dx, there_y = y + dy;
                return there_x >= 0 && there_y >= 0 && there_x < static_cast<int>(other.width()) &&
                       there_y < static_cast<int>(other.height()) &&
                       other.at(static_cast<std::uint32_t>(there_x), static_cast<std::uint32_t>(there_y)) !=
                           GridCell::kUnknown;
            };
            bool is_covered = false;
            for (int dy = -1; dy <= 1; ++dy) {
                for (int dx = -1; dx <= 1; ++dx) is_covered = is_covered || is_known(dx, dy);
            }
            ++known;
            covered += is_covered ? 1 : 0;
        }
    }
    return static_cast<double>(covered) / known;
}

// Promise: of a lap in two halves, each a map of its own, the joined map's grid covers what both grids do, and is the
// room's floor plan; with places for the depth images of one half it still has nearly all of it.
TEST(RoomGrid, OfTwoMapsCoversBoth) {
    const TrackedRoom first("static_loop", 1, {.frames = 640, .first = 0, .end = 340});
    const TrackedRoom second("static_loop", 1, {.frames = 640, .first = 300, .end = 640});
    const TrackedRoom both(first, second, Limits::room());
    Limits fewer = Limits::room();
    fewer.depth_images_max = static_cast<std::uint32_t>(first.job().looks().size());
    const TrackedRoom thinned(first, second, fewer);
    ASSERT_TRUE(first.job().has_grid() && second.job().has_grid() && both.job().has_grid());
    const Score score = score_of(both);
    std::printf("the first covers %.3f of the second; both %.3f and %.3f; %d of %d right, in the halves %.4f, %.4f\n",
                covered_share(second, first), covered_share(first, both), covered_share(second, both), score.right,
                score.seen, score_of(first).share(), score_of(second).share());
    std::printf("%zu images; of %zu %.3f and %.3f, %.4f right\n", both.job().looks().size(),
                thinned.job().looks().size(), covered_share(first, thinned), covered_share(second, thinned),
                score_of(thinned).share());
    EXPECT_LT(covered_share(second, first), 0.8) << "else nothing is shown";
    EXPECT_GE(covered_share(first, both), 0.98);
    EXPECT_GE(covered_share(second, both), 0.98);
    EXPECT_GE(score.share(), 0.97) << score.right << " of " << score.seen;
    ASSERT_TRUE(thinned.job().has_grid());
    EXPECT_GE(covered_share(first, thinned), 0.95);
    EXPECT_GE(covered_share(second, thinned), 0.95);
    EXPECT_GE(score_of(thinned).share(), 0.97);
}

// Promise: after a minute among three people who walk the grid is the room's floor plan, and not one cell is occupied
// where they walked and nothing stands.
TEST(RoomGrid, AMinuteAmongPeopleMinute) {
    const TrackedRoom room("walking_xyz", 1, {.frames = 1800});
    ASSERT_TRUE(room.job().has_grid());
    const Score score = score_of(room);
    EXPECT_GE(score.share(), 0.97) << score.right << " of " << score.seen;
    EXPECT_GE(score.occupied, 200);
    EXPECT_EQ(score.people, 0) << "of " << score.occupied;
    EXPECT_EQ(score.ghosts, 0);
}

}  // namespace
}  // namespace stillmesh::room_grid_test
