#include "engine/matching/feature_grid.hpp"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <cstdint>
#include <limits>
#include <vector>

#include "engine/base/random.hpp"
#include "engine/features/features.hpp"
#include "tests/support/memory.hpp"

namespace stillmesh::feature_grid_test {
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

std::vector<std::uint32_t> visited_by_rows(const FeatureGrid& grid, double x, double y, double radius) {
    std::vector<std::uint32_t> out;
    grid.visit_rows(x, y, radius, [&](std::size_t begin, std::size_t end) {
        for (std::size_t k = begin; k < end; ++k) out.push_back(grid.in_order()[k]);
    });
    return out;
}

// The column or row of a coordinate in an image of `size` pixels; beyond the image: the nearest.
double cell_of(double pixels, std::uint32_t size) {
    return std::clamp(std::floor(pixels / 16), 0.0, std::floor((size - 1) / 16.0));
}

// What has to be visited, found without a grid: row by row of cells, column by column, ascending within a cell.
std::vector<std::uint32_t> in_touched_cells(const std::vector<Keypoint>& keypoints, std::uint32_t width,
                                            std::uint32_t height, double x, double y, double radius) {
    std::vector<std::uint32_t> out;
    for (double row = cell_of(y - radius, height); row <= cell_of(y + radius, height); ++row) {
        for (double column = cell_of(x - radius, width); column <= cell_of(x + radius, width); ++column) {
            for (std::uint32_t i = 0; i < keypoints.size(); ++i) {
                if (cell_of(keypoints[i].x, width) == column && cell_of(keypoints[i].y, height) == row) {
                    out.push_back(i);
                }
            }
        }
    }
    return out;
}

// Promise: visited are the features of the cells that the square touches, each once, row by row of cells, column by
// column, ascending within a cell; one by one and by rows; for images built one after the other in the same memory.
TEST(FeatureGrid, VisitsTheCellsThatTheSquareTouches) {
    Random random(1);
    std::size_t visits = 0;
    for (int round = 0; round < 60; ++round) {
        Limits limits;
        limits.image_width_max = 33 + random.below(2015);
        limits.image_height_max = 33 + random.below(2015);
        limits.features_max = 400;
        Grid grid(limits);
        ASSERT_EQ(grid.used_bytes(), grid.planned_bytes());
        for (int image = 0; image < 3; ++image) {
            const std::uint32_t width = 33 + random.below(limits.image_width_max - 32);
            const std::uint32_t height = 33 + random.below(limits.image_height_max - 32);
            const auto keypoints = random_keypoints(random, random.below(401), width, height);
            grid->build(width, height, std::span<const Keypoint>(keypoints));
            ASSERT_EQ(grid->in_order().size(), keypoints.size());
            for (int query = 0; query < 20; ++query) {
                const double x = random.uniform(-50.0, width + 50.0);
                const double y = random.uniform(-50.0, height + 50.0);
                const double radius = random.uniform(0, 80);
                const auto expected = in_touched_cells(keypoints, width, height, x, y, radius);
                ASSERT_EQ(visited(*grid, x, y, radius), expected);
                ASSERT_EQ(visited_by_rows(*grid, x, y, radius), expected);
                visits += expected.size();
            }
        }
    }
    EXPECT_GT(visits, 10000U) << "hardly a query had anything to visit";
}

// Promise: every feature within the radius is visited, in the image and around it.
TEST(FeatureGrid, MissesNothingWithinTheRadius) {
    Random random(3);
    std::size_t near = 0;
    for (int round = 0; round < 100; ++round) {
        Grid grid(Limits::tiny());
        const auto keypoints = random_keypoints(random, 100, 160, 120);
        grid->build(160, 120, std::span<const Keypoint>(keypoints));
        const double x = random.uniform(-20, 180);
        const double y = random.uniform(-20, 140);
        const double radius = random.uniform(0, 60);
        const auto seen = visited(*grid, x, y, radius);
        for (std::uint32_t i = 0; i < keypoints.size(); ++i) {
            if (std::hypot(static_cast<double>(keypoints[i].x) - x, static_cast<double>(keypoints[i].y) - y) > radius) {
                continue;
            }
            ++near;
            EXPECT_TRUE(std::find(seen.begin(), seen.end(), i) != seen.end()) << "missed";
        }
    }
    EXPECT_GT(near, 500U) << "hardly a query had anything near";
}

// Promise: no feature, a radius of nothing or of everything, places beyond all sense: nothing, all, the nearest cell; a
// place that is no number is the first cell.
TEST(FeatureGrid, BoundsOfSense) {
    Random random(2);
    Grid grid(Limits::tiny());
    grid->build(160, 120, std::span<const Keypoint>{});
    EXPECT_TRUE(visited(*grid, 80, 60, 1e9).empty());
    auto keypoints = random_keypoints(random, 100, 160, 120);
    keypoints[40].x = keypoints[40].y = 1;  // in the first cell and in the last is something
    keypoints[60].x = 158, keypoints[60].y = 118;
    grid->build(160, 120, std::span<const Keypoint>(keypoints));
    constexpr double kInfinity = std::numeric_limits<double>::infinity();
    for (const double radius : {1e9, 1e300, kInfinity}) EXPECT_EQ(visited(*grid, 40, 40, radius).size(), 100U);

    const auto first = in_touched_cells(keypoints, 160, 120, 0, 0, 0);
    const auto last = in_touched_cells(keypoints, 160, 120, 159, 119, 0);
    for (const double wild : {-1e300, -kInfinity, std::numeric_limits<double>::quiet_NaN()}) {
        EXPECT_EQ(visited(*grid, wild, wild, 5), first) << wild;
    }
    for (const double wild : {1e300, kInfinity}) EXPECT_EQ(visited(*grid, wild, wild, 5), last) << wild;
}

// Promise: features on the image's border and beyond it, as an extractor of others may give, lie in the nearest cell.
TEST(FeatureGrid, FeaturesBeyondTheBorder) {
    Grid grid(Limits::tiny());
    std::vector<Keypoint> keypoints(4);
    keypoints[0].x = 160, keypoints[0].y = 120;
    keypoints[1].x = 1e9F, keypoints[1].y = 1e9F;
    keypoints[2].x = -1, keypoints[2].y = -0.5F;
    keypoints[3].x = std::numeric_limits<float>::quiet_NaN(), keypoints[3].y = 0;
    grid->build(160, 120, std::span<const Keypoint>(keypoints));
    EXPECT_EQ(visited(*grid, 158, 118, 3), (std::vector<std::uint32_t>{0, 1}));
    EXPECT_EQ(visited(*grid, 3, 3, 3), (std::vector<std::uint32_t>{2, 3}));
    EXPECT_TRUE(visited(*grid, 80, 60, 3).empty());
}

}  // namespace
}  // namespace stillmesh::feature_grid_test
