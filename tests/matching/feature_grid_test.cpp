#include "engine/matching/feature_grid.hpp"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <cstdint>
#include <limits>
#include <vector>

#include "engine/base/random.hpp"
#include "tests/support/memory.hpp"

namespace stillmesh {
namespace {

using Grid = test::InMemory<FeatureGrid>;

std::vector<Keypoint> random_keypoints(Random& random, std::uint32_t count, std::uint32_t width, std::uint32_t height) {
    std::vector<Keypoint> out(count);
    for (Keypoint& k : out) {
        k.x = static_cast<float>(random.uniform(0, width));
        k.y = static_cast<float>(random.uniform(0, height));
        if (random.below(8) == 0) k.x = static_cast<float>(random.below(width / 16 + 1) * 16);  // on a border of cells
    }
    return out;
}

std::vector<std::uint32_t> visited(const FeatureGrid& grid, double x, double y, double radius) {
    std::vector<std::uint32_t> out;
    grid.visit_near(x, y, radius, [&](std::uint32_t i) { out.push_back(i); });
    return out;
}

// Promise: everything within the radius is visited, once; nothing farther than a cell beyond the square is; in the same
// order whatever the radius: row by row of cells, ascending within a cell; by rows at once the same.
TEST(FeatureGrid, VisitsASupersetOnce) {
    Random random(1);
    for (int round = 0; round < 200; ++round) {
        Limits limits;
        limits.image_width_max = 33 + random.below(2015);
        limits.image_height_max = 33 + random.below(2015);
        limits.features_max = 400;
        Grid grid(limits);
        ASSERT_EQ(grid.used_bytes(), grid.planned_bytes());
        for (int image = 0; image < 3; ++image) {  // built again and again, for smaller images too
            const std::uint32_t width = 33 + random.below(limits.image_width_max - 32);
            const std::uint32_t height = 33 + random.below(limits.image_height_max - 32);
            const auto keypoints = random_keypoints(random, random.below(401), width, height);
            grid->build(width, height, keypoints);
            for (int query = 0; query < 20; ++query) {
                const double x = random.uniform(-50.0, width + 50.0);
                const double y = random.uniform(-50.0, height + 50.0);
                const double radius = random.uniform(0, 80);
                const auto seen = visited(*grid, x, y, radius);
                std::vector<std::uint32_t> by_rows;
                grid->visit_rows(x, y, radius, [&](std::size_t begin, std::size_t end) {
                    for (std::size_t k = begin; k < end; ++k) by_rows.push_back(grid->in_order()[k]);
                });
                ASSERT_EQ(by_rows, seen);
                std::vector<bool> is_seen(keypoints.size());
                std::uint64_t last = 0;
                for (const std::uint32_t i : seen) {
                    ASSERT_LT(i, keypoints.size());
                    ASSERT_FALSE(is_seen[i]) << "twice";
                    is_seen[i] = true;
                    const auto column =
                        std::min(static_cast<std::uint64_t>(keypoints[i].x) / 16, (width - std::uint64_t{1}) / 16);
                    const auto row =
                        std::min(static_cast<std::uint64_t>(keypoints[i].y) / 16, (height - std::uint64_t{1}) / 16);
                    const std::uint64_t key = (row << 40U | column << 20U | i) + 1;
                    ASSERT_LT(last, key) << "out of order";
                    last = key;
                }
                // Beyond the image the nearest cells stand in; inside it, only cells that the square touches.
                const double x_inside = std::clamp(x, 0.0, width - 1.0);
                const double y_inside = std::clamp(y, 0.0, height - 1.0);
                for (std::size_t i = 0; i < keypoints.size(); ++i) {
                    const double dx = static_cast<double>(keypoints[i].x) - x;
                    const double dy = static_cast<double>(keypoints[i].y) - y;
                    if (dx * dx + dy * dy <= radius * radius) {
                        ASSERT_TRUE(is_seen[i]) << "missed";
                    }
                    if (!is_seen[i]) continue;
                    if (x == x_inside) {
                        ASSERT_LE(std::abs(dx), radius + 16);
                    }
                    if (y == y_inside) {
                        ASSERT_LE(std::abs(dy), radius + 16);
                    }
                }
            }
        }
    }
}

// Promise: no feature, a radius of nothing or of everything, places beyond all sense: no crash, and all or none.
TEST(FeatureGrid, BoundsOfSense) {
    Random random(2);
    Grid grid(Limits::tiny());
    grid->build(160, 120, {});
    EXPECT_TRUE(visited(*grid, 80, 60, 1e9).empty());
    const auto keypoints = random_keypoints(random, 100, 160, 120);
    grid->build(160, 120, keypoints);
    EXPECT_EQ(visited(*grid, 80, 60, 1e9).size(), 100U);
    EXPECT_EQ(visited(*grid, 80, 60, 1e300).size(), 100U);
    EXPECT_FALSE(visited(*grid, 40, 40, std::numeric_limits<double>::infinity()).empty());
    for (const double wild : {-1e300, 1e300, std::numeric_limits<double>::quiet_NaN()}) {
        EXPECT_LE(visited(*grid, wild, wild, 5).size(), 100U);
    }
    // A feature exactly on the border between images and beyond (an extractor of others) falls into the last cell.
    std::vector<Keypoint> corner(1);
    corner[0].x = 159.99F;
    corner[0].y = 119.99F;
    grid->build(160, 120, corner);
    EXPECT_EQ(visited(*grid, 158, 118, 3).size(), 1U);
    EXPECT_TRUE(visited(*grid, 10, 10, 3).empty());
}

}  // namespace
}  // namespace stillmesh
