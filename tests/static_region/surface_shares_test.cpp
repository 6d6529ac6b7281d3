#include "engine/static_region/surface_shares.hpp"

#include <gtest/gtest.h>

#include <algorithm>
#include <cstdint>
#include <vector>

#include "engine/frame/depth_cells.hpp"
#include "tests/static_region/scenes.hpp"
#include "tests/support/memory.hpp"

namespace stillmesh::surface_shares_test {
namespace {

using namespace test;

constexpr std::uint32_t kCell_px = 16, kColumns = 40, kRows = 30, kRings = 3;  // of 640x480, and a reach of .075

// Surfaces of a depth image in millimetres, and matches on them.
struct Picture {
    Picture() : depth(640 * 480, 0) {
        frame.depth = {depth.data(), 640, 480, 640};
        frame.depth_units_per_m = 1000;
    }
    void paint(std::uint32_t left, std::uint32_t top, std::uint32_t right, std::uint32_t bottom, std::uint16_t mm) {
        for (std::uint32_t y = top; y < bottom; ++y)
            for (std::uint32_t x = left; x < right; ++x) depth[y * 640 + x] = mm;
    }
    void match(std::uint32_t x, std::uint32_t y) {
        Correspondence c;
        c.feature = static_cast<std::uint32_t>(keypoints.size());
        c.p_camera = at_pixel(x, y, depth[y * 640 + x] / 1000.0);
        c.has_depth = c.p_camera.z() > 0;
        Keypoint keypoint;
        keypoint.x = static_cast<float>(x);
        keypoint.y = static_cast<float>(y);
        keypoints.push_back(keypoint);
        matches.push_back(c);
    }
    void share_out(double reach = 0.075) {
        Parameters parameters;
        parameters.region.reach = reach;
        InMemory<Shares> shares(parameters);
        shares->shares.share_out(frame, keypoints, matches);
    }
    // Of a match, in square metres up to the area of a cell one metre away.
    [[nodiscard]] double surface(std::size_t i) const {
        return matches[i].extent * matches[i].p_camera.z() * matches[i].p_camera.z();
    }

    std::vector<std::uint16_t> depth;
    Frame frame;
    std::vector<Keypoint> keypoints;
    std::vector<Correspondence> matches;

private:
    struct Shares {
        static void plan(ArenaPlan& arena, const Parameters&) { SurfaceShares::plan(arena, Limits{}); }
        void create(Arena& arena, const Parameters& parameters) { shares.create(arena, Limits{}, parameters); }
        SurfaceShares shares;
    };
};

// Every cell that a way of at most three cells on one surface joins to a match, by relaxation.
double reached(const Picture& picture) {
    const auto depth_of = [&](std::uint32_t cell) {
        const std::uint32_t x = cell % kColumns * kCell_px + kCell_px / 2,
                            y = cell / kColumns * kCell_px + kCell_px / 2;
        return static_cast<double>(picture.depth[y * 640 + x]);
    };
    const auto is_joined = [](double a, double b) {
        const double nearer = std::min(a, b);
        return nearer > 0 && std::abs(a - b) <= 30 + 0.08 * nearer;
    };
    std::vector<std::uint32_t> ways(kColumns * kRows, 1000);
    for (const Correspondence& c : picture.matches) {
        const Keypoint& k = picture.keypoints[c.feature];
        const std::uint32_t cell =
            static_cast<std::uint32_t>(k.y) / kCell_px * kColumns + static_cast<std::uint32_t>(k.x) / kCell_px;
        if (c.has_depth && is_joined(1000 * c.p_camera.z(), depth_of(cell))) ways[cell] = 0;
    }
    for (std::uint32_t round = 0; round < kRings; ++round) {
        for (std::uint32_t a = 0; a < ways.size(); ++a) {
            for (std::uint32_t b = 0; b < ways.size(); ++b) {
                const std::uint32_t dx =
                    a % kColumns > b % kColumns ? a % kColumns - b % kColumns : b % kColumns - a % kColumns;
                const std::uint32_t dy =
                    a / kColumns > b / kColumns ? a / kColumns - b / kColumns : b / kColumns - a / kColumns;
                if (dx + dy == 1 && is_joined(depth_of(a), depth_of(b))) ways[b] = std::min(ways[b], ways[a] + 1);
            }
        }
    }
    double sum = 0;
    for (std::uint32_t cell = 0; cell < ways.size(); ++cell) {
        if (ways[cell] <= kRings) sum += depth_of(cell) * depth_of(cell) * 1e-6;
    }
    return sum;
}

// Promise: what all matches stand for is every cell within reach of one of them, once, whatever surfaces there are.
TEST(SurfaceShares, EveryCellOnceByBruteForce) {
    for (std::uint64_t seed = 0; seed < 10; ++seed) {
        Random random(seed);
        Picture picture;
        picture.paint(0, 0, 640, 480, 3000);
        for (int body = 0; body < 6; ++body) {
            const auto left = static_cast<std::uint32_t>(random.uniform(0, 500));
            const auto top = static_cast<std::uint32_t>(random.uniform(0, 400));
            const auto mm = static_cast<std::uint16_t>(body == 5 ? 0 : random.uniform(800, 2600));
            picture.paint(left, top, left + 130, top + 75, mm);
        }
        for (int i = 0; i < 40; ++i) {
            const std::uint32_t x = static_cast<std::uint32_t>(random.uniform(0, 640));
            const std::uint32_t y = static_cast<std::uint32_t>(random.uniform(0, 480));
            if (picture.depth[y * 640 + x] == picture.depth[(y / 16 * 16 + 8) * 640 + x / 16 * 16 + 8])
                picture.match(x, y);
        }
        picture.share_out();
        double sum = 0;
        for (std::size_t i = 0; i < picture.matches.size(); ++i) {
            if (picture.matches[i].has_depth) sum += picture.surface(i);
        }
        EXPECT_NEAR(sum, reached(picture), 1e-3 * sum) << "seed " << seed;
        EXPECT_GT(sum, 100);
    }
}

// Promise: depth goes on over no more than the step, from either side, and nowhere from a cell without depth; the
// neighbours of a cell are those that share a side with it, within the picture.
TEST(DepthCells, SurfacesAndNeighbours) {
    constexpr DepthStep kStep{.base_mm = 30, .share_permille = 80};
    for (const std::uint32_t z_mm : {500U, 1000U, 4000U, 9000U}) {
        const std::uint32_t most = z_mm + 30 + z_mm * 80 / 1000;
        EXPECT_TRUE(goes_on(z_mm, most, kStep) && goes_on(most, z_mm, kStep));
        EXPECT_FALSE(goes_on(z_mm, most + 1, kStep) || goes_on(most + 1, z_mm, kStep));
        EXPECT_FALSE(goes_on(0, z_mm, kStep) || goes_on(z_mm, 0, kStep) || goes_on(0, 0, kStep));
    }
    constexpr std::size_t kWide = 5, kCells = 15;
    for (std::size_t a = 0; a < kCells; ++a) {
        std::vector<std::size_t> wanted, found;
        for (std::size_t b = 0; b < kCells; ++b) {
            const auto apart = [](std::size_t x, std::size_t y) { return x > y ? x - y : y - x; };
            if (apart(a % kWide, b % kWide) + apart(a / kWide, b / kWide) == 1) wanted.push_back(b);
        }
        for_each_neighbour(a, kWide, kCells, [&](std::size_t b) { found.push_back(b); });
        std::sort(found.begin(), found.end());
        EXPECT_EQ(found, wanted) << a;
    }
}

// Promise: a crowd of matches on a small body stands for that body, and one match on the wall behind for the wall
// around it; matches in one cell share it equally.
TEST(SurfaceShares, ACrowdSharesItsBody) {
    Picture picture;
    picture.paint(0, 0, 640, 480, 3000);
    picture.paint(160, 160, 224, 224, 1000);                                            // 4 x 4 cells
    for (std::uint32_t i = 0; i < 100; ++i) picture.match(162 + i % 10, 162 + i / 10);  // all in its first cell
    picture.match(480, 240);
    picture.share_out();
    for (std::size_t i = 0; i < 100; ++i) EXPECT_NEAR(picture.surface(i), 10 / 100.0, 1e-6);  // 3 steps from a corner
    EXPECT_NEAR(picture.surface(100), 25 * 9.0, 1e-3);  // all cells within three steps
}

// Promise: without a reach a match has its own cell; one that lies on no surface of its cell, or beside all cells, or
// has no depth, stands for the square of its distance as before.
TEST(SurfaceShares, WithoutAReachAndBesideASurface) {
    Picture picture;
    picture.paint(0, 0, 640, 480, 2000);
    picture.match(100, 100);
    picture.match(300, 300);
    picture.matches[1].p_camera = at_pixel(300, 300, 1.0);  // on a rod before the wall that its cell does not show
    picture.match(500, 300);
    picture.matches[2].has_depth = false;
    picture.share_out(0);
    EXPECT_NEAR(picture.surface(0), 4.0, 1e-6);
    EXPECT_EQ(picture.matches[1].extent, 1.0);
    EXPECT_EQ(picture.matches[2].extent, 1.0);
}

// Promise: any size of picture is within the memory that its limits planned.
TEST(SurfaceShares, AnySizeFits) {
    for (const auto& [width, height] : {std::pair<std::uint32_t, std::uint32_t>{64, 48},
                                        {160, 120},
                                        {321, 243},
                                        {848, 480},
                                        {1280, 720},
                                        {2047, 64},
                                        {64, 2047},
                                        {2047, 2047}}) {
        Limits limits;
        limits.image_width_max = width;
        limits.image_height_max = height;
        ArenaPlan plan;
        SurfaceShares::plan(plan, limits);
        const Memory memory(plan.used_bytes());
        Arena arena(memory.span());
        SurfaceShares shares;
        shares.create(arena, limits, Parameters{});
        ASSERT_LE(arena.used_bytes(), plan.used_bytes());
        const std::vector<std::uint16_t> depth(std::size_t{width} * height, 1500);
        Frame frame;
        frame.depth = {depth.data(), width, height, width};
        frame.depth_units_per_m = 1000;
        std::vector<Keypoint> keypoints;
        std::vector<Correspondence> matches;
        for (const std::uint32_t corner : {0U, 1U, 2U, 3U}) {
            Keypoint keypoint;
            keypoint.x = static_cast<float>(corner % 2 == 0 ? 0 : width - 1);
            keypoint.y = static_cast<float>(corner / 2 == 0 ? 0 : height - 1);
            Correspondence c;
            c.feature = corner;
            c.p_camera = Vector3(0, 0, 1.5);
            c.has_depth = true;
            keypoints.push_back(keypoint);
            matches.push_back(c);
        }
        shares.share_out(frame, keypoints, matches);
        EXPECT_GE(matches[0].extent, 1.0) << width << "x" << height;
    }
}

}  // namespace
}  // namespace stillmesh::surface_shares_test
