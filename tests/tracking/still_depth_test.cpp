#include "engine/tracking/still_depth.hpp"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <cstdint>
#include <deque>
#include <memory>
#include <vector>

#include "engine/base/random.hpp"
#include "tests/support/small_world.hpp"

namespace stillmesh::still_depth_test {
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

struct Told {
    std::uint32_t x = 0, y = 0;
    double z_m = 0;
    bool is_moving = false;
};

// What StillDepth says that it does, said anew: a flood of its own for every feature, and each cell asks them all.
class Model {
public:
    Model(const Frame& frame, const DepthLayout& layout) : layout_(layout) {
        const std::uint32_t last = layout.cell_px - 1;
        for (std::uint32_t y = 0; y < layout.rows * layout.cell_px; y += layout.cell_px) {
            for (std::uint32_t x = 0; x < layout.columns * layout.cell_px; x += layout.cell_px) {
                const std::uint32_t low = last / 4, high = last - low;
                std::vector<double> seen;
                for (const auto& [u, v] :
                     {std::pair{last / 2, last / 2}, {low, low}, {high, low}, {low, high}, {high, high}}) {
                    if (frame.depth.at(x + u, y + v) != 0)
                        seen.push_back(frame.depth.at(x + u, y + v) / frame.depth_units_per_m);
                }
                std::sort(seen.begin(), seen.end());
                const double median = seen.size() < 3 ? 0.0 : seen[seen.size() / 2];
                const bool is_used = median >= DepthParameters{}.z_min_m && median <= DepthParameters{}.z_max_m;
                mm_.push_back(is_used ? static_cast<int>(std::floor(1000 * median + 0.5)) : 0);
            }
        }
    }
    void tell(const Told& told) {
        const std::uint32_t column = told.x / layout_.cell_px, row = told.y / layout_.cell_px;
        if (column >= layout_.columns || row >= layout_.rows) return;
        const std::size_t cell = row * layout_.columns + column;
        if (mm_[cell] == 0 || std::abs(std::lround(1000 * told.z_m) - mm_[cell]) > 20 + mm_[cell] * 40 / 1000) return;
        for (Flood& flood : floods_) {
            if (flood.from != cell) continue;
            flood.is_moving = flood.is_moving || told.is_moving;
            return;
        }
        floods_.push_back({cell, told.is_moving, {}});
    }
    std::vector<std::uint16_t> finish() {
        for (Flood& flood : floods_) spread(flood);
        std::vector<int> verdict(mm_.size(), 0);  // 1 stands, 2 moves
        for (std::size_t cell = 0; cell < mm_.size(); ++cell) {
            int nearest = -1;
            for (const Flood& flood : floods_) {
                const int steps = flood.steps[cell];
                if (steps < 0 || (nearest >= 0 && steps >= nearest)) continue;
                nearest = steps;
                verdict[cell] = flood.is_moving ? 2 : 1;
            }
        }
        std::vector<std::uint16_t> out;
        const int columns = static_cast<int>(layout_.columns), rows = static_cast<int>(layout_.rows);
        for (int cell = 0; cell < columns * rows; ++cell) {
            bool is_beside = false;
            for (int other = 0; other < columns * rows; ++other) {
                is_beside = is_beside || (verdict[static_cast<std::size_t>(other)] == 2 &&
                                          std::abs(other / columns - cell / columns) <= 1 &&
                                          std::abs(other % columns - cell % columns) <= 1);
            }
            const auto depth = static_cast<std::uint16_t>(mm_[static_cast<std::size_t>(cell)]);
            const bool is_moving = verdict[static_cast<std::size_t>(cell)] == 2;
            out.push_back(is_moving   ? static_cast<std::uint16_t>(depth | 0x8000U)
                          : is_beside ? std::uint16_t{0}
                                      : depth);
        }
        return out;
    }

private:
    struct Flood {
        std::size_t from = 0;
        bool is_moving = false;
        std::vector<int> steps;  // to each cell; -1: not reached
    };
    [[nodiscard]] bool is_one_surface(std::size_t a, std::size_t b) const {
        const int nearer = std::min(mm_[a], mm_[b]);
        return nearer > 0 && std::abs(mm_[a] - mm_[b]) <= 20 + nearer * 40 / 1000;
    }
    void spread(Flood& flood) const {
        flood.steps.assign(mm_.size(), -1);
        flood.steps[flood.from] = 0;
        std::deque<std::size_t> waiting{flood.from};
        for (; !waiting.empty(); waiting.pop_front()) {
            const std::size_t at = waiting.front(), column = at % layout_.columns;
            const auto go = [&](bool is_there, std::size_t to) {
                if (!is_there || flood.steps[to] >= 0 || !is_one_surface(at, to)) return;
                flood.steps[to] = flood.steps[at] + 1;
                waiting.push_back(to);
            };
            go(column > 0, at - 1);
            go(column + 1 < layout_.columns, at + 1);
            go(at >= layout_.columns, at - layout_.columns);
            go(at + layout_.columns < mm_.size(), at + layout_.columns);
        }
    }

    DepthLayout layout_;
    std::vector<int> mm_;
    std::vector<Flood> floods_;
};

// Promise: for pictures of any size, with holes, smears and steps that are just too high, and features on them and
// beside them, it is the image that floods from each feature alone give.
TEST(StillDepthModel, FloodsFromEachFeature) {
    Random random(1);
    for (int round = 0; round < 40; ++round) {
        // Cells of 1 to 24 pixels, few of them: a camera that is narrow or low.
        const std::uint32_t cell_px = round % 4 == 3 ? 24 : 1 + random.below(9);
        CameraModel camera = test::small_camera();
        const bool is_low = random.below(2) == 0;
        camera.width = (is_low ? kDepthColumnsMax * cell_px : 12 * cell_px) - random.below(cell_px);
        camera.height = (is_low ? 9 * cell_px : kDepthRowsMax * cell_px) - random.below(cell_px);
        const DepthLayout layout = depth_layout(camera);
        ASSERT_EQ(layout.cell_px, cell_px);
        ArenaPlan plan;
        StillDepth::plan(plan, limits_with_images());
        DepthImages::plan(plan, limits_with_images());
        const test::Memory memory(plan.used_bytes());
        Arena arena(memory.span());
        DepthImages images;
        images.create(arena, limits_with_images(), camera);
        StillDepth still;
        still.create(arena, limits_with_images(), DepthParameters{});

        std::vector<std::uint16_t> pixels(std::size_t{camera.width} * camera.height);
        const std::uint32_t base = round % 5 == 0 ? 6000 : round % 5 == 1 ? 300 : 1000 + random.below(2000);
        const std::uint32_t roughness = 1 + random.below(20 + base / 15);
        std::vector<std::uint32_t> bumps(std::size_t{layout.columns + 1} * (layout.rows + 1));
        for (std::uint32_t& bump : bumps) bump = random.below(roughness);
        for (std::uint32_t y = 0; y < camera.height; ++y) {
            for (std::uint32_t x = 0; x < camera.width; ++x) {
                const std::uint32_t mm = base + bumps[y / cell_px * (layout.columns + 1) + x / cell_px];
                const std::uint32_t kind = random.below(12);
                pixels[std::size_t{y} * camera.width + x] =
                    static_cast<std::uint16_t>(kind < 2    ? 0
                                               : kind == 2 ? random.below(65536)
                                                           : 2 * mm + random.below(3));
            }
        }
        Frame frame;
        frame.depth = {pixels.data(), camera.width, camera.height, camera.width};
        frame.depth_units_per_m = 2000;
        still.begin(frame, images);
        Model model(frame, layout);
        for (std::uint32_t i = 0; i < 1 + random.below(8); ++i) {
            Told told;
            told.x = random.below(camera.width);
            told.y = random.below(camera.height);
            told.z_m = 1e-3 * (base + random.below(roughness));
            told.is_moving = random.below(2) == 0;
            for (std::uint32_t again = 0; again < 1 + random.below(2); ++again, told.is_moving = !told.is_moving) {
                Keypoint keypoint;
                keypoint.x = static_cast<float>(told.x);
                keypoint.y = static_cast<float>(told.y);
                still.note(keypoint, told.z_m, told.is_moving);
                model.tell(told);
            }
        }
        std::vector<std::uint16_t> out(std::size_t{layout.columns} * layout.rows);
        still.finish(out);
        ASSERT_EQ(out, model.finish()) << round;
    }
}

}  // namespace
}  // namespace stillmesh::still_depth_test
