#include "engine/tracking/empty_places.hpp"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <cstdint>
#include <memory>
#include <vector>

#include "platform/linux/cpu_kernels.hpp"
#include "tests/support/memory.hpp"
#include "tests/support/small_world.hpp"

namespace stillmesh::empty_places_test {
namespace {

constexpr std::uint32_t kWidth = 160;

// A map of a wall two metres ahead, and a camera that looks at it.
class Wall {
public:
    Wall() : world_(test::small_parameters()), frame_(*world_) {
        frame_.measure();
        places_.create(world_->parameters);
        world_->local_map.build(world_.map(), SE3{});  // of nothing yet
        for (int i = 0; i < 100; ++i) {
            const Handle<MapPoint> taken =
                world_.add_point(Vector3(0.1 * (i % 10) - 0.45, 0.08 * (i / 10) - 0.36, 2.0));
            world_[taken].is_suspect = i >= 80;  // these say nothing
            world_->local_map.add(taken.slot());
        }
    }
    // So many points of something that stood before the wall and has gone, all in the middle of one cell.
    void crowd(int points) {
        for (int i = 0; i < points; ++i)
            world_->local_map.add(world_.add_point(test::point_at_pixel(85, 65, 1)).slot());
    }
    // The depth image: `left_m` in the left half, `right_m` in the right.
    [[nodiscard]] EmptyPlaces::Agreement seen(double left_m, double right_m, const SE3& camera = {}) {
        for (std::size_t i = 0; i < frame_.depth().size(); ++i) {
            frame_.depth()[i] = static_cast<std::uint16_t>(5000 * (i % kWidth < kWidth / 2 ? left_m : right_m));
        }
        return places_.agreement(frame_.measured, camera, 1.0, *world_);
    }

private:
    test::SmallWorld world_;
    test::SmallFrame frame_;
    EmptyPlaces places_;
};

// Promise: of the points in view that stand still, those whose depth is measured are there, those that the depth image
// looks through are empty, and those behind somebody, without depth or outside the picture are neither. The wall's 80
// points lie in 10 by 8 of the 16 by 12 cells of the picture.
TEST(EmptyPlaces, AgreementCountsWhatIsThereAndWhatIsLookedThrough) {
    Wall wall;
    const EmptyPlaces::Agreement all = wall.seen(2.0, 2.0);
    EXPECT_EQ(all.points_there, 80U);
    const std::uint32_t cells = all.there;
    EXPECT_GE(cells, 30U);
    EXPECT_EQ(all.empty, 0U);
    const EmptyPlaces::Agreement through = wall.seen(3.5, 3.5);
    EXPECT_EQ(through.points_there, 0U);
    EXPECT_EQ(through.there, 0U);
    EXPECT_EQ(through.empty, cells);
    const EmptyPlaces::Agreement half = wall.seen(2.0, 3.5);
    EXPECT_EQ(half.points_there, 40U);
    EXPECT_EQ(half.there + half.empty, cells);
    EXPECT_NEAR(half.there, cells / 2.0, 4);
    const EmptyPlaces::Agreement hidden = wall.seen(1.0, 0.0);
    EXPECT_EQ(hidden.points_there + hidden.there + hidden.empty, 0U);
    // A metre farther from the wall than it believes: everything is beyond the wall.
    const EmptyPlaces::Agreement wrong = wall.seen(2.0, 2.0, SE3{Matrix3::Identity(), Vector3(0, 0, 1)});
    EXPECT_EQ(wrong.points_there, 0U);
    EXPECT_GT(wrong.empty, 10U);
    const EmptyPlaces::Agreement away = wall.seen(2.0, 2.0, SE3{Matrix3::Identity(), Vector3(50, 0, 0)});
    EXPECT_EQ(away.there + away.empty, 0U);
}

// Promise: what has gone counts by the area that it covered, however many features it had.
TEST(EmptyPlaces, AgreementGoesByArea) {
    Wall wall;
    const EmptyPlaces::Agreement before = wall.seen(2.0, 2.0);
    wall.crowd(100);
    const EmptyPlaces::Agreement seen = wall.seen(2.0, 2.0);
    EXPECT_EQ(seen.empty, 1U);
    EXPECT_GE(seen.there + 1, before.there);
}

// One point two metres ahead, and a frame whose depth around it a test paints.
class EmptyPlace : public testing::Test {
protected:
    EmptyPlace() { start(test::small_parameters()); }
    void start(const Parameters& parameters) {
        frame_.reset();
        world_ = std::make_unique<test::SmallWorld>(parameters);
        frame_ = std::make_unique<test::SmallFrame>(**world_);
        frame_->measure();
        (*world_)->clock.frame = 7;
        places_ = EmptyPlaces{};
        places_.create((*world_)->parameters);
        (*world_)->local_map.build(world_->map(), SE3{});
        points_.clear();
        add();
        paint(3.5);
    }
    void add() {
        points_.push_back(world_->add_point(test::point_at_pixel(80, 60, 2)));
        (*world_)->local_map.add(points_.back().slot());
    }
    void paint(double z_m) {
        std::fill(frame_->depth().begin(), frame_->depth().end(), static_cast<std::uint16_t>(z_m * 5000 + 0.5));
    }
    void paint_pixel(std::uint32_t x, std::uint32_t y, double z_m) {
        frame_->depth()[y * 160 + x] = static_cast<std::uint16_t>(z_m * 5000 + 0.5);
    }
    // One frame; how many views in a row have now seen the first point's place empty, -1: it is gone.
    int look(double noise_depth = 1) {
        places_.note_empty(frame_->measured, SE3{}, noise_depth, **world_);
        const MapPoint* const point = world_->map().points().find(points_[0]);
        return point != nullptr ? point->empty_views : -1;
    }

    std::unique_ptr<test::SmallWorld> world_;
    std::unique_ptr<test::SmallFrame> frame_;
    EmptyPlaces places_;
    std::vector<Handle<MapPoint>> points_;
};

// Promise: a point goes with the view that completes emptiness.views in which its place was seen to be empty, and is
// counted as emptied; views in which it is there take one back each, and those that see nothing take none.
TEST_F(EmptyPlace, GoesAfterSomeViews) {
    for (const std::uint32_t views : {1U, 5U}) {
        Parameters parameters = test::small_parameters();
        parameters.emptiness.views = views;
        start(parameters);
        for (std::uint32_t i = 1; i < views; ++i) EXPECT_EQ(look(), static_cast<int>(i));
        if (views > 1) {
            paint(0);
            EXPECT_EQ(look(), static_cast<int>(views) - 1);
            paint(2);
            EXPECT_EQ(look(), static_cast<int>(views) - 2);
            paint(3.5);
            EXPECT_EQ(look(), static_cast<int>(views) - 1);
        }
        EXPECT_EQ(world_->map().statistics().points_emptied, 0U);
        EXPECT_EQ(look(), -1);
        EXPECT_EQ(world_->map().statistics().points_emptied, 1U);
        EXPECT_EQ(look(), -1) << "the list still names its slot";
    }
    start(test::small_parameters());
    paint(2);
    EXPECT_EQ(look(), 0) << "there, and never empty";
}

// Promise: a place is empty where depth is measured beyond it by margin_m and `sigmas` deviations of sensor and point,
// times the noise of the frame; exactly.
TEST_F(EmptyPlace, EmptyIsBeyondNoiseAndMargin) {
    for (const double sigmas : {0.0, 5.0}) {
        for (const double margin_m : {0.06, 0.2}) {
            for (const double noise : {1.0, 4.0}) {
                Parameters parameters = test::small_parameters();
                parameters.emptiness.sigmas = sigmas;
                parameters.emptiness.margin_m = margin_m;
                const double sensor_m = parameters.depth.sigma_z_per_m2 * 4;
                const double end_m = 2 + margin_m + sigmas * std::sqrt(noise * (sensor_m * sensor_m + 1e-4));
                start(parameters);
                paint(end_m + 0.0005);
                EXPECT_EQ(look(noise), 1);
                start(parameters);
                paint(end_m - 0.0005);
                EXPECT_EQ(look(noise), 0);
                // As far before it as that it is there, and takes a view back; nearer it is hidden.
                (*world_)[points_[0]].empty_views = 3;
                paint(4 - end_m + 0.0005);
                EXPECT_EQ(look(noise), 2);
                paint(4 - end_m - 0.0005);
                EXPECT_EQ(look(noise), 2);
            }
        }
    }
}

// Promise: one look of nine around the place, reach_px apart, that is not beyond it, or has no depth, keeps the point;
// what lies between or outside does not.
TEST_F(EmptyPlace, AllAroundMustBeEmpty) {
    for (const std::uint32_t reach_px : {3U, 6U}) {
        Parameters parameters = test::small_parameters();
        parameters.emptiness.reach_px = reach_px;
        for (const double z_m : {0.0, 1.0, 2.0}) {
            for (std::uint32_t n = 0; n < 9; ++n) {
                start(parameters);
                paint_pixel(80 + (n % 3) * reach_px - reach_px, 60 + (n / 3) * reach_px - reach_px, z_m);
                EXPECT_EQ(look(), 0) << n;
            }
            start(parameters);
            paint_pixel(81, 60, z_m);
            paint_pixel(80 + reach_px + 1, 60, z_m);
            EXPECT_EQ(look(), 1);
        }
    }
}

// Promise: a point that the frame saw is not empty, and its views are forgotten; those of one without a weight are
// kept.
TEST_F(EmptyPlace, WhatIsSeenIsNotEmpty) {
    EXPECT_EQ(look(), 1);
    MapPoint& point = (*world_)[points_[0]];
    point.last_seen_frame = 7;
    point.is_suspect = true;
    EXPECT_EQ(look(), 1);
    point.is_suspect = false;
    EXPECT_EQ(look(), 0);
}

// Promise: places outside the picture, too near or too far to be measured, say nothing.
TEST_F(EmptyPlace, OnlyWhatCanBeMeasured) {
    Parameters parameters = test::small_parameters();
    for (const double z_max_m : {3.0, 6.0}) {
        parameters.depth.z_max_m = z_max_m;
        for (const Vector3& p : {test::point_at_pixel(80, 60, z_max_m + 0.1), test::point_at_pixel(80, 60, 0.2),
                                 test::point_at_pixel(1, 60, 2), test::point_at_pixel(80, 119, 2), Vector3(0, 0, -2)}) {
            start(parameters);
            paint(12);
            store(p, (*world_)[points_[0]].world);
            EXPECT_EQ(look(), 0);
        }
        start(parameters);
        paint(12);
        store(test::point_at_pixel(80, 60, z_max_m - 0.1), (*world_)[points_[0]].world);
        EXPECT_EQ(look(), 1);
    }
}

// Promise: places_per_frame places are looked at in a frame, in turn, so that all of them come by; a reset begins anew.
TEST_F(EmptyPlace, TakesTurns) {
    for (const std::uint32_t per_frame : {0U, 1U, 3U, 400U}) {
        Parameters parameters = test::small_parameters();
        parameters.emptiness.places_per_frame = per_frame;
        parameters.emptiness.views = 100;
        start(parameters);
        for (int i = 1; i < 12; ++i) add();
        for (std::uint32_t frame = 1; frame <= 24; ++frame) {
            look();
            std::uint32_t sum = 0, least = 100, most = 0;
            for (const Handle<MapPoint> point : points_) {
                const std::uint32_t views = (*world_)[point].empty_views;
                sum += views;
                least = std::min(least, views);
                most = std::max(most, views);
            }
            EXPECT_EQ(sum, frame * std::min(per_frame, 12U));
            EXPECT_LE(most - least, 1U);
        }
        if (per_frame != 1) continue;
        start(parameters);
        add();
        look();
        places_.reset();
        look();
        EXPECT_EQ((*world_)[points_[0]].empty_views + (*world_)[points_[1]].empty_views, 2);
        EXPECT_EQ((*world_)[points_[1]].empty_views, 2) << "the same one again";
    }
}

}  // namespace
}  // namespace stillmesh::empty_places_test
