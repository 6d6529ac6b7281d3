#include "engine/tracking/empty_places.hpp"

#include <gtest/gtest.h>

#include <cstdint>
#include <vector>

#include "platform/linux/cpu_kernels.hpp"
#include "tests/support/memory.hpp"

namespace stillmesh {
namespace {

constexpr std::uint32_t kWidth = 160;
constexpr std::uint32_t kHeight = 120;

// A map of a wall two metres ahead, and a camera that looks at it.
class Wall {
public:
    Wall() : memory_(planned()) {
        Arena arena(memory_.span());
        configuration_.features.count = kLimits.features_max;
        configuration_.features.levels = kLimits.pyramid_levels_max;
        CameraModel camera;
        camera.width = kWidth;
        camera.height = kHeight;
        camera.fx = camera.fy = 120;
        camera.cx = 80;
        camera.cy = 60;
        measured_.create(arena, kLimits, configuration_, camera, cpu_kernels(), nullptr);
        map_.create(arena, kLimits);
        local_map_.create(arena, kLimits);
        places_.create(configuration_);
        local_map_.build(map_, SE3{});  // of nothing yet
        for (int i = 0; i < 100; ++i) {
            const Handle<MapPoint> taken = map_.add_point().value();
            MapPoint& point = *map_.points().find(taken);
            store(Vector3(0.1 * (i % 10) - 0.45, 0.08 * (i / 10) - 0.36, 2.0), point.world);
            point.is_suspect = i >= 80;  // these say nothing
            local_map_.add(taken.slot());
        }
    }
    // The depth image: `left_m` in the left half, `right_m` in the right.
    [[nodiscard]] EmptyPlaces::Agreement seen(double left_m, double right_m, const SE3& camera = {}) const {
        std::vector<std::uint16_t> depth(std::size_t{kWidth} * kHeight);
        for (std::size_t i = 0; i < depth.size(); ++i) {
            depth[i] = static_cast<std::uint16_t>(5000 * (i % kWidth < kWidth / 2 ? left_m : right_m));
        }
        Frame frame;
        frame.depth = {depth.data(), kWidth, kHeight, kWidth};
        frame.depth_units_per_m = 5000;
        return places_.agreement(frame, measured_, camera, 1.0, local_map_, map_);
    }

private:
    static constexpr Limits kLimits = Limits::tiny();
    static std::size_t planned() {
        ArenaPlan plan;
        MeasuredFrame::plan(plan, kLimits);
        Map::plan(plan, kLimits);
        LocalMap::plan(plan, kLimits);
        return plan.used_bytes();
    }
    Parameters configuration_;
    test::Memory memory_;
    MeasuredFrame measured_;
    Map map_;
    LocalMap local_map_;
    EmptyPlaces places_;
};

// Promise: of the points in view that stand still, those whose depth is measured are there, those that the depth image
// looks through are empty, and those behind somebody, without depth or outside the picture are neither.
TEST(EmptyPlaces, AgreementCountsWhatIsThereAndWhatIsLookedThrough) {
    const Wall wall;
    const EmptyPlaces::Agreement all = wall.seen(2.0, 2.0);
    EXPECT_EQ(all.there, 80U);
    EXPECT_EQ(all.empty, 0U);
    const EmptyPlaces::Agreement through = wall.seen(3.5, 3.5);
    EXPECT_EQ(through.there, 0U);
    EXPECT_EQ(through.empty, 80U);
    const EmptyPlaces::Agreement half = wall.seen(2.0, 3.5);
    EXPECT_EQ(half.there, 40U);
    EXPECT_EQ(half.empty, 40U);
    const EmptyPlaces::Agreement hidden = wall.seen(1.0, 0.0);
    EXPECT_EQ(hidden.there, 0U);
    EXPECT_EQ(hidden.empty, 0U);
    // A metre farther from the wall than it believes: everything is beyond the wall.
    const EmptyPlaces::Agreement wrong = wall.seen(2.0, 2.0, SE3{Matrix3::Identity(), Vector3(0, 0, 1)});
    EXPECT_EQ(wrong.there, 0U);
    EXPECT_GT(wrong.empty, 10U);
    const EmptyPlaces::Agreement away = wall.seen(2.0, 2.0, SE3{Matrix3::Identity(), Vector3(50, 0, 0)});
    EXPECT_EQ(away.there + away.empty, 0U);
}

}  // namespace
}  // namespace stillmesh
