#include "engine/tracking/attention.hpp"

#include <gtest/gtest.h>

#include <cstdint>
#include <vector>

#include "engine/base/random.hpp"
#include "tests/support/small_world.hpp"

namespace stillmesh::attention_test {
namespace {

struct Matches {
    std::vector<Keypoint> keypoints;
    std::vector<Correspondence> all;
    std::vector<std::uint16_t> still;
    void add(double x, double y, bool is_moving, bool is_still) {
        if (is_still) still.push_back(static_cast<std::uint16_t>(all.size()));
        Keypoint keypoint;
        keypoint.x = static_cast<float>(x);
        keypoint.y = static_cast<float>(y);
        Correspondence match;
        match.feature = static_cast<std::uint32_t>(keypoints.size());
        match.is_moving = match.is_dynamic = is_moving;
        keypoints.push_back(keypoint);
        all.push_back(match);
    }
    // Cells of 10x7.5 px.
    [[nodiscard]] MovingCells cells(std::uint32_t moving_per_still) const {
        return moving_cells(test::small_camera(), keypoints, all, still, moving_per_still);
    }
};

// Promise: one moving match marks its own cell, not those around it; two mark what lies between; and one that stands
// still beside four takes the mark.
TEST(MovingCells, AreWhereAllThatIsMatchedMoves) {
    Matches matches;
    matches.add(55, 55, true, false);
    EXPECT_TRUE(matches.cells(4).holds(5, 7));
    EXPECT_FALSE(matches.cells(4).holds(4, 7));
    EXPECT_FALSE(matches.cells(4).holds(6, 8));
    matches.add(75, 55, true, false);
    EXPECT_TRUE(matches.cells(4).holds(6, 7));
    matches.add(65, 65, false, true);
    EXPECT_FALSE(matches.cells(4).holds(6, 7));
    EXPECT_TRUE(matches.cells(4).holds(5, 7));
    matches.add(55, 56, false, true);
    EXPECT_FALSE(matches.cells(4).holds(5, 7));
    matches.add(160, 120, true, false);  // beyond the picture: its last cell
    EXPECT_TRUE(matches.cells(4).holds(15, 15));
    matches.all.back().is_dynamic = false;  // it has a vote still
    EXPECT_FALSE(matches.cells(4).holds(15, 15));
}

// Promise: as by asking every match of every cell.
TEST(MovingCells, AreAsByForce) {
    Random random(7);
    for (int round = 0; round < 50; ++round) {
        Matches matches;
        const std::uint32_t count = random.below(400);
        for (std::uint32_t i = 0; i < count; ++i) {
            const double x = random.uniform() * 160, y = random.uniform() * 120;
            const bool is_moving = random.uniform() < (x < 80 ? 0.9 : 0.2);
            matches.add(x, y, is_moving, !is_moving && random.uniform() < 0.8);
        }
        const std::uint32_t per_still = 1 + random.below(6);
        const MovingCells cells = matches.cells(per_still);
        std::vector<bool> is_still(count);
        for (const std::uint16_t i : matches.still) is_still[i] = true;
        for (int row = 0; row < 16; ++row) {
            for (int column = 0; column < 16; ++column) {
                std::uint32_t moving = 0, still = 0;
                for (std::uint32_t i = 0; i < count; ++i) {
                    const int dx = static_cast<int>(matches.keypoints[i].x / 10.0F) - column;
                    const int dy = static_cast<int>(matches.keypoints[i].y / 7.5F) - row;
                    if (dx < -1 || dx > 1 || dy < -1 || dy > 1) continue;
                    const std::uint32_t weight = dx == 0 && dy == 0 ? 4 : 1;
                    moving += matches.all[i].is_moving ? weight : 0;
                    still += is_still[i] ? weight : 0;
                }
                EXPECT_EQ(cells.holds(static_cast<std::uint32_t>(column), static_cast<std::uint32_t>(row)),
                          moving >= 2 && moving >= per_still * still);
            }
        }
    }
}

}  // namespace
}  // namespace stillmesh::attention_test
