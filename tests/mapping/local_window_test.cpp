#include "engine/mapping/local_window.hpp"

#include <gtest/gtest.h>

#include <cstdint>
#include <memory>
#include <vector>

#include "tests/loop_closing/ring.hpp"
#include "tests/support/map_fault.hpp"

namespace stillmesh::local_window_test {
namespace {

using test::Ring;

constexpr std::uint32_t kKeyframes = 12;

// A way with the drift of odometry in it, and a window around its newest keyframe.
class Rig {
public:
    explicit Rig(const Parameters& configuration = test::configuration_of_ring())
        : ring(std::make_unique<Ring>(configuration)), memory_(planned_bytes()) {
        Arena arena(memory_.span());
        window.create(arena, ring->world());
        window.cancel();
        for (std::uint32_t i = 0; i < kKeyframes; ++i) {
            handles.push_back(ring->add_keyframe(i));
            at(i).time_ns = static_cast<std::int64_t>(i) * 1'000'000'000;
        }
    }
    [[nodiscard]] Map& map() { return ring->map(); }
    [[nodiscard]] Keyframe& at(std::uint32_t i) { return *map().keyframes().find(handles[i]); }
    // Around the newest of the first kKeyframes, with so many neighbours.
    std::uint32_t choose(std::uint32_t neighbours = 10) {
        std::vector<std::uint32_t> slots(neighbours);
        slots.resize(map().best_covisible(handles[kKeyframes - 1].slot(), slots, 15));
        std::vector<Handle<Keyframe>> around;
        for (const std::uint32_t slot : slots) around.push_back(map().keyframes().handle_of(slot));
        return window.choose(handles[kKeyframes - 1], around);
    }
    void collect() {
        while (!window.is_collected()) EXPECT_GT(window.collect(), 0U);
    }
    void finish() {
        WorkBudget budget(100'000'000);
        ASSERT_EQ(window.adjust(budget), Progress::kDone);
        EXPECT_GT(window.commit(), 0U);
        EXPECT_FALSE(window.is_chosen());
    }
    // How far the newest lies from where it was, seen from keyframe i.
    [[nodiscard]] double off_m(std::uint32_t i) {
        const SE3 here = at(i).world_from_camera.inverse() * at(kKeyframes - 1).world_from_camera;
        const SE3 truth = ring->truth(i).inverse() * ring->truth(kKeyframes - 1);
        return (here.translation - truth.translation).norm();
    }

    std::unique_ptr<Ring> ring;
    LocalWindow window;
    std::vector<Handle<Keyframe>> handles;

private:
    static std::size_t planned_bytes() {
        ArenaPlan plan;
        LocalWindow::plan(plan, Ring::limits());
        return plan.used_bytes();
    }
    test::Memory memory_;
};

// Promise: an adjustment puts the newest keyframe where it was seen from; keyframes that are not in the window, or
// fixed, stay to the bit.
TEST(LocalWindow, AnAdjustmentTakesTheDriftAway) {
    Rig rig;
    const double before_m = rig.off_m(kKeyframes - 4);
    ASSERT_GT(before_m, 0.02);
    std::vector<SE3> poses;
    for (std::uint32_t i = 0; i < kKeyframes; ++i) poses.push_back(rig.at(i).world_from_camera);
    static_cast<void>(rig.choose(3));
    ASSERT_TRUE(rig.window.is_chosen());
    rig.collect();
    rig.finish();
    EXPECT_LT(rig.off_m(kKeyframes - 4), 0.3 * before_m);
    EXPECT_GT(rig.ring->world().statistics.mapping.adjustment_iterations, 0U);
    std::uint32_t moved = 0;
    for (std::uint32_t i = 0; i < kKeyframes; ++i) {
        moved += rig.at(i).world_from_camera.translation == poses[i].translation ? 0U : 1U;
    }
    EXPECT_GE(moved, 2U);
    EXPECT_LE(moved, 4U) << "the newest and its three neighbours";
    EXPECT_EQ(test::find_fault(rig.map()), nullptr);
}

// Promise: the camera goes with the newest keyframe; one that was made while the adjustment ran goes with its parent.
TEST(LocalWindow, WhatIsNewerGoesAlong) {
    Rig rig;
    static_cast<void>(rig.choose(3));
    rig.collect();
    const Handle<Keyframe> made_since = rig.ring->add_keyframe(kKeyframes);
    ASSERT_TRUE(rig.map().keyframes().find(made_since)->parent == rig.handles[kKeyframes - 1]);
    const SE3 parent = rig.at(kKeyframes - 1).world_from_camera;
    const SE3 before = rig.map().keyframes().find(made_since)->world_from_camera;
    rig.finish();
    const SE3 now = rig.map().keyframes().find(made_since)->world_from_camera;
    const SE3 by = rig.at(kKeyframes - 1).world_from_camera * parent.inverse();
    EXPECT_GT((now.translation - before.translation).norm(), 1e-4);
    EXPECT_LT((now.translation - (by * before).translation).norm(), 1e-12);
    EXPECT_LT((rig.ring->camera().translation - by.translation).norm(), 1e-12);
}

// Promise: what tracking has learnt of a point while the adjustment ran is added to what the adjustment found.
TEST(LocalWindow, WhatWasLearntMeanwhileStays) {
    const Vector3 learnt(0.01, -0.02, 0.03);
    std::vector<Vector3> found[2];
    for (const bool is_learning : {false, true}) {
        Rig rig;
        static_cast<void>(rig.choose(3));
        rig.collect();
        Pool<MapPoint>& points = rig.map().points();
        for (std::uint32_t slot = 0; slot < points.slots_count(); ++slot) {
            if (is_learning && points.is_taken(slot))
                store(vector_of(points.at(slot).world) + learnt, points.at(slot).world);
        }
        rig.finish();
        for (std::uint32_t slot = 0; slot < points.slots_count(); ++slot)
            if (points.is_taken(slot)) found[is_learning ? 1 : 0].push_back(vector_of(points.at(slot).world));
    }
    ASSERT_EQ(found[0].size(), found[1].size());
    std::size_t to_the_bit = 0;
    for (std::size_t i = 0; i < found[0].size(); ++i) {
        const double off_m = (found[1][i] - found[0][i] - learnt).norm();
        ASSERT_LT(off_m, 0.1 * learnt.norm()) << i;  // what follows a keyframe turns with it
        to_the_bit += off_m < 1e-12 ? 1U : 0U;
    }
    EXPECT_GT(to_the_bit, 100U);
}

// Promise: keyframes of an earlier visit hold still; where all of a window would move, the oldest holds.
TEST(LocalWindow, TheWorldIsHeld) {
    Parameters configuration = test::configuration_of_ring();
    configuration.mapping.settled_s = 2.5;
    Rig settled(configuration);
    std::vector<SE3> poses;
    for (std::uint32_t i = 0; i < kKeyframes; ++i) poses.push_back(settled.at(i).world_from_camera);
    static_cast<void>(settled.choose());
    settled.collect();
    settled.finish();
    for (std::uint32_t i = 0; i < kKeyframes; ++i) {
        const bool has_moved = !(settled.at(i).world_from_camera.translation == poses[i].translation);
        EXPECT_EQ(has_moved, i + 3 >= kKeyframes) << i;
    }

    configuration.mapping.settled_s = 1000;
    configuration.map.shared_min = 4000;
    Rig all(configuration);
    const SE3 oldest = all.at(kKeyframes - 4).world_from_camera;
    const SE3 newest = all.at(kKeyframes - 1).world_from_camera;
    static_cast<void>(all.choose(3));
    ASSERT_TRUE(all.window.is_chosen());
    all.collect();
    all.finish();
    EXPECT_EQ(all.at(kKeyframes - 4).world_from_camera.translation, oldest.translation);
    EXPECT_NE(all.at(kKeyframes - 1).world_from_camera.translation, newest.translation);
}

// Promise: a keyframe that sees too few points of the map is not adjusted, nor is any when it is switched off.
TEST(LocalWindow, FewPointsAreNotEnough) {
    Parameters configuration = test::configuration_of_ring();
    configuration.pose.inliers_min = 1000;
    Rig few(configuration);
    EXPECT_GT(few.choose(), 0U);
    EXPECT_FALSE(few.window.is_chosen());
    configuration = test::configuration_of_ring();
    configuration.mapping.is_adjusting = false;
    Rig off(configuration);
    EXPECT_GT(off.choose(), 0U);
    EXPECT_FALSE(off.window.is_chosen());
}

// Promise: after first_iterations_max steps with outliers come second_iterations_max without them.
TEST(LocalWindow, OutliersMakeASecondRound) {
    std::uint64_t iterations[3] = {};
    for (std::uint32_t second = 0; second < 3; ++second) {
        Parameters configuration = test::configuration_of_ring();
        configuration.mapping.first_iterations_max = 2;
        configuration.mapping.second_iterations_max = second;
        Rig rig(configuration);
        // Every fifth point of the newest keyframe lies elsewhere: what was seen of it fits no place.
        const std::span<const Observation> seen = rig.map().observations(rig.handles[kKeyframes - 1]);
        for (std::size_t k = 0; k < seen.size(); k += 5) {
            MapPoint* const point = rig.map().points().find(seen[k].point);
            if (point != nullptr) point->world[0] += 1;
        }
        static_cast<void>(rig.choose(3));
        rig.collect();
        rig.finish();
        iterations[second] = rig.ring->world().statistics.mapping.adjustment_iterations;
    }
    EXPECT_EQ(iterations[0], 2U);
    EXPECT_EQ(iterations[1], 3U);
    EXPECT_EQ(iterations[2], 4U);
}

// Promise: a window that is given up leaves the map as it was, and the next one equals one of a new machine; whatever
// leaves the map meanwhile is left out.
TEST(LocalWindow, MayBeGivenUp) {
    Rig used, fresh;
    static_cast<void>(used.choose());
    static_cast<void>(used.window.collect());
    const std::uint64_t before = used.map().changes_hash();
    used.window.cancel();
    EXPECT_FALSE(used.window.is_chosen());
    EXPECT_EQ(used.map().changes_hash(), before);
    for (Rig* const rig : {&used, &fresh}) {
        static_cast<void>(rig->choose());
        static_cast<void>(rig->window.collect());
        rig->map().release_keyframe(rig->handles[kKeyframes - 3]);
        for (std::uint32_t slot = 0; slot < 400; slot += 3) {
            if (rig->map().points().is_taken(slot)) rig->map().release_point(rig->map().points().handle_of(slot));
        }
        rig->collect();
        rig->finish();
        EXPECT_EQ(test::find_fault(rig->map()), nullptr) << test::find_fault(rig->map());
    }
    EXPECT_EQ(used.map().changes_hash(), fresh.map().changes_hash());
    EXPECT_LT(used.off_m(kKeyframes - 5), 0.05);
}

// Promise: an observation that fits nowhere ends; a point that is left without another keeps its last one.
TEST(LocalWindow, OutliersEnd) {
    Rig rig;
    static_cast<void>(rig.choose());
    const Handle<Keyframe> newest = rig.handles[kKeyframes - 1];
    std::uint32_t spoilt = 0;
    for (const Observation& o : rig.map().observations(newest)) {
        if (spoilt == 5) break;
        MapPoint* const point = rig.map().points().find(o.point);
        if (point == nullptr || point->observers < 3) continue;
        // Another feature shows it now, somewhere else.
        const auto index = static_cast<std::uint32_t>(&o - rig.map().observations(newest).data());
        rig.map().average(newest, index, o.point, {3.0 * static_cast<double>(o.normalised_x) + 2, 3, 3});
        ++spoilt;
    }
    ASSERT_EQ(spoilt, 5U);
    const std::uint32_t observed = [&] {
        std::uint32_t count = 0;
        for (const Observation& o : rig.map().observations(newest)) count += rig.map().points().find(o.point) ? 1U : 0U;
        return count;
    }();
    rig.collect();
    rig.finish();
    std::uint32_t left = 0;
    for (const Observation& o : rig.map().observations(newest)) left += rig.map().points().find(o.point) ? 1U : 0U;
    EXPECT_GE(rig.ring->world().statistics.mapping.observations_dropped, 5U);
    EXPECT_LE(left + 5, observed);
    EXPECT_EQ(test::find_fault(rig.map()), nullptr) << test::find_fault(rig.map());
}

}  // namespace
}  // namespace stillmesh::local_window_test
