#include "engine/tracking/still_depth.hpp"

#include <gtest/gtest.h>

#include <cstdint>
#include <memory>
#include <vector>

#include "tests/support/small_world.hpp"

namespace stillmesh {
namespace {

Limits limits_with_images() {
    Limits out = Limits::tiny();
    out.depth_images_max = 2;
    return out;
}

// A depth image of 160 x 120 pixels, hence cells of 2 x 2, painted by rectangles.
class StillDepthTest : public testing::Test {
protected:
    StillDepthTest() : world_(test::small_parameters(), limits_with_images()), pixels_(160U * 120, 0) {
        ArenaPlan plan;
        StillDepth::plan(plan, limits_with_images());
        memory_ = std::make_unique<test::Memory>(plan.used_bytes());
        Arena arena(memory_->span());
        still_.create(arena, limits_with_images(), DepthParameters{});
        EXPECT_EQ(arena.used_bytes(), plan.used_bytes());
        frame_.depth = {pixels_.data(), 160, 120, 160};
        frame_.depth_units_per_m = 5000;
    }
    void paint(std::uint32_t x0, std::uint32_t x1, std::uint32_t y0, std::uint32_t y1, double z_m) {
        for (std::uint32_t y = y0; y < y1; ++y) {
            for (std::uint32_t x = x0; x < x1; ++x)
                pixels_[y * 160U + x] = static_cast<std::uint16_t>(5000 * z_m + 0.5);
        }
    }
    void begin() { still_.begin(frame_, world_->depth_images); }
    void note(std::uint32_t x, std::uint32_t y, double z_m, bool is_moving) {
        Keypoint keypoint;
        keypoint.x = static_cast<float>(x);
        keypoint.y = static_cast<float>(y);
        still_.note(keypoint, z_m, is_moving);
    }
    std::vector<std::uint16_t> finish() {
        std::vector<std::uint16_t> out(4800);
        still_.finish(out);
        return out;
    }
    static std::uint16_t at(const std::vector<std::uint16_t>& image, std::uint32_t x, std::uint32_t y) {
        return image[y / 2 * 80U + x / 2];
    }

    test::SmallWorld world_;
    std::vector<std::uint16_t> pixels_;
    Frame frame_;
    std::unique_ptr<test::Memory> memory_;
    StillDepth still_;
};

// Promise: cells are mm along the axis; what was not measured, or lies out of the range that is used, is 0.
TEST_F(StillDepthTest, IsWhatWasMeasured) {
    paint(0, 160, 0, 120, 2.5);
    paint(20, 30, 20, 30, 0);
    paint(40, 50, 20, 30, 7.5);  // beyond depth.z_max_m
    paint(60, 70, 20, 30, 0.1);  // nearer than depth.z_min_m
    begin();
    const std::vector<std::uint16_t> image = finish();
    EXPECT_EQ(at(image, 100, 100), 2500);
    EXPECT_EQ(at(image, 24, 24), 0);
    EXPECT_EQ(at(image, 44, 24), 0);
    EXPECT_EQ(at(image, 64, 24), 0);
}

// Promise: a body with moving features is marked as far as its depth goes on, and a border of a cell left out; what
// stands behind it stays, and so does another body at its depth that stands still.
TEST_F(StillDepthTest, MarksWhatMoves) {
    paint(0, 160, 0, 120, 3.0);
    paint(40, 80, 20, 100, 1.5);
    paint(110, 140, 20, 100, 1.5);
    begin();
    for (const std::uint32_t y : {30U, 50U, 70U, 90U}) {
        note(60, y, 1.5, true);
        note(124, y, 1.5, false);
        note(10, y, 3.0, false);
        note(96, y, 3.0, false);
    }
    const std::vector<std::uint16_t> image = finish();
    for (std::uint32_t y = 20; y < 100; y += 2) {
        for (std::uint32_t x = 40; x < 80; x += 2)
            ASSERT_EQ(at(image, x, y), DepthImage::kMoving | 1500) << x << " " << y;
        EXPECT_EQ(at(image, 38, y), 0);
        EXPECT_EQ(at(image, 80, y), 0);
        EXPECT_EQ(at(image, 34, y), 3000);
        EXPECT_EQ(at(image, 84, y), 3000);
        EXPECT_EQ(at(image, 124, y), 1500);
    }
}

// Promise: where one surface carries both, each cell goes with the nearest: feet on a floor do not take the floor
// along.
TEST_F(StillDepthTest, NearestFeatureDecides) {
    paint(0, 160, 0, 120, 2.0);
    begin();
    note(20, 60, 2.0, true);
    note(60, 60, 2.0, false);
    const std::vector<std::uint16_t> image = finish();
    EXPECT_EQ(at(image, 34, 60), DepthImage::kMoving | 2000);
    EXPECT_EQ(at(image, 50, 60), 2000);
    EXPECT_EQ(at(image, 150, 60), 2000);
}

// Promise: a feature whose depth is not its cell's says nothing of the cell; without any, all is kept.
TEST_F(StillDepthTest, AFeatureOfAnotherSurfaceSaysNothing) {
    paint(0, 160, 0, 120, 2.0);
    begin();
    note(20, 60, 1.0, true);
    note(200, 60, 2.0, true);  // out of the picture
    for (const std::uint16_t depth : finish()) ASSERT_EQ(depth, 2000);
}

}  // namespace
}  // namespace stillmesh
