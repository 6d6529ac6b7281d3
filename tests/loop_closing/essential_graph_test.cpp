#include "engine/loop_closing/essential_graph.hpp"

#include <gtest/gtest.h>

#include <cstdint>
#include <iterator>
#include <span>
#include <utility>
#include <vector>

#include "tests/support/map_fault.hpp"
#include "tests/support/memory.hpp"

namespace stillmesh::essential_graph_test {
namespace {

constexpr std::uint32_t kKeyframes = 21;
constexpr std::uint64_t kApart_frames = 20;
constexpr double kStep_m = 0.2;
constexpr double kOff_m = 0.3;  // what the loop says that the way was too long

Limits limits_of_test() {
    Limits limits = Limits::tiny();
    limits.keyframes_max = 24;
    limits.features_max = 100;
    return limits;
}

Parameters configuration_of_test() {
    Parameters out;
    out.loop.gap_frames = 100;
    return out;
}

// A straight way along x, each keyframe the child of the one before it; none shares points unless a test says so.
class Way {
public:
    Way() : memory_(planned_bytes()) {
        Arena arena(memory_.span());
        world.create(arena, limits_of_test(), configuration_of_test(),
                     {.width = 160, .height = 120, .fx = 130, .fy = 130});
        graph.create(arena, world, limits_of_test().keyframes_max);
        EXPECT_EQ(arena.used_bytes(), memory_.span().size());
        for (std::uint32_t i = 0; i < kKeyframes; ++i) {
            const Handle<Keyframe> handle = world.map.add_keyframe();
            Keyframe& keyframe = *world.map.keyframes().find(handle);
            keyframe.frame = kApart_frames * i;
            keyframe.world_from_camera.translation.x() = kStep_m * i;
            if (i > 0) keyframe.parent = handles.back();
            handles.push_back(handle);
        }
    }
    void share(std::uint32_t a, std::uint32_t b, std::uint32_t points) {
        for (std::uint32_t i = 0; i < points; ++i) {
            Observation seen;
            seen.point = world.map.add_point().value();
            world.map.add_observation(handles[a], seen);
            world.map.add_observation(handles[b], seen);
        }
        ASSERT_EQ(test::find_fault(world.map), nullptr);
    }
    // The last keyframe was measured to lie nearer to the first.
    void add_loop() {
        SE3 first_from_last;
        first_from_last.translation.x() = kStep_m * (kKeyframes - 1) - kOff_m;
        graph.add_loop(handles.front(), handles.back(), first_from_last);
    }
    void solve(std::uint64_t settled_end = 0) {
        const std::uint32_t units = graph.build(settled_end);
        EXPECT_GT(units, 0U);
        EXPECT_LE(units, EssentialGraph::build_units_max(limits_of_test()));
        WorkBudget budget(10'000'000);
        ASSERT_EQ(graph.step(budget), Progress::kDone);
        graph.move_keyframes();
    }
    void set_parent(std::uint32_t child, std::uint32_t parent) {
        world.map.keyframes().find(handles[child])->parent = handles[parent];
    }
    // How far keyframe i has moved, along x.
    [[nodiscard]] double moved_m(std::uint32_t i) {
        return world.map.keyframes().find(handles[i])->world_from_camera.translation.x() - kStep_m * i;
    }

    World world;
    EssentialGraph graph;
    std::vector<Handle<Keyframe>> handles;

private:
    static std::size_t planned_bytes() {
        ArenaPlan plan;
        World::plan(plan, limits_of_test());
        EssentialGraph::plan(plan, limits_of_test().keyframes_max);
        return plan.used_bytes();
    }
    test::Memory memory_;
};

// Promise: without a loop all edges say what is, and nothing moves.
TEST(EssentialGraph, WithoutALoopNothingMoves) {
    Way way;
    way.share(3, 7, 30);
    way.solve();
    for (std::uint32_t i = 0; i < kKeyframes; ++i) EXPECT_NEAR(way.moved_m(i), 0, 1e-12) << i;
}

// Promise: a loop is spread over the way evenly, as a chain of equal springs spreads it, the first keyframe stays, and
// the loop, which is measured with care, is nearly kept.
TEST(EssentialGraph, ALoopIsSpreadOverTheWay) {
    Way way;
    way.add_loop();
    way.solve();
    EXPECT_EQ(way.moved_m(0), 0);
    const double edge_m2 = 0.01 * 0.01 / 0.2;  // the least share that counts
    const double loop_m2 = 0.005 * 0.005;
    const double all_m2 = (kKeyframes - 1) * edge_m2 + loop_m2;
    for (std::uint32_t i = 1; i < kKeyframes; ++i) {
        EXPECT_NEAR(way.moved_m(i), -kOff_m * i * edge_m2 / all_m2, 1e-5) << i;
    }
}

// Promise: keyframes that share many points hold together more than those that share few.
TEST(EssentialGraph, WhatSharesMuchHoldsTogether) {
    Way way;
    way.share(5, 6, 60);
    way.add_loop();
    way.solve();
    const double usual_m = way.moved_m(10) - way.moved_m(11);
    EXPECT_NEAR((way.moved_m(5) - way.moved_m(6)) / usual_m, 0.2 / 0.6, 0.01);
}

// Promise: what keyframes share across a long time counts where a loop was closed before, and not otherwise; across a
// short time always.
TEST(EssentialGraph, OldViewsCountOnceALoopWasClosed) {
    const auto between_m = [](std::uint32_t a, std::uint32_t b, std::uint64_t settled_end) {
        Way way;
        way.share(a, b, 60);
        way.add_loop();
        way.solve(settled_end);
        return (way.moved_m(a) - way.moved_m(b)) / (b - a);
    };
    const double all_m = kOff_m / (kKeyframes - 1);
    EXPECT_NEAR(between_m(4, 14, 0), all_m, 0.02 * all_m) << "does not count";
    EXPECT_NEAR(between_m(4, 14, 14 * kApart_frames), all_m, 0.02 * all_m) << "14 is not settled yet";
    EXPECT_LT(between_m(4, 14, 14 * kApart_frames + 1), 0.5 * all_m);
    EXPECT_LT(between_m(4, 7, 0), 0.7 * all_m);
}

// Promise: a loop whose keyframe has left is none; more loops than are remembered forget the oldest; reset() forgets
// all; a child that is older than its parent is taken in.
TEST(EssentialGraph, LoopsAreForgotten) {
    Way way;
    way.add_loop();
    way.world.map.release_keyframe(way.handles.back());
    way.solve();
    for (std::uint32_t i = 0; i + 1 < kKeyframes; ++i) EXPECT_NEAR(way.moved_m(i), 0, 1e-12) << i;

    Way many;
    many.add_loop();
    for (std::uint32_t i = 0; i < EssentialGraph::loops_max(limits_of_test().keyframes_max); ++i) {
        SE3 as_it_is;
        as_it_is.translation.x() = kStep_m;
        many.graph.add_loop(many.handles[3], many.handles[4], as_it_is);
    }
    many.solve();
    EXPECT_NEAR(many.moved_m(kKeyframes - 1), 0, 1e-9);

    Way again;
    again.add_loop();
    again.graph.reset();
    again.world.map.keyframes().find(again.handles[8])->frame = 1000;  // newer than its children
    again.solve();
    EXPECT_NEAR(again.moved_m(kKeyframes - 1), 0, 1e-9);
}

// Promise: loops are listed with what their keyframes share, the newest first, as many as fit; without the newest where
// it is pending, and without one whose keyframe has left.
TEST(EssentialGraph, ListsLoops) {
    Way way;
    std::vector<KeyframeLink> listed(4);
    EXPECT_EQ(way.graph.list_loops(0, listed), 0U);
    EXPECT_EQ(way.graph.list_loops(1, listed), 0U);
    way.share(2, 9, 7);
    for (const auto& [a, b] : {std::pair(0, 8), std::pair(1, 12), std::pair(2, 9)}) {
        way.graph.add_loop(way.handles[static_cast<std::size_t>(a)], way.handles[static_cast<std::size_t>(b)], {});
    }
    const auto frame = [&](std::size_t i) { return way.world.map.keyframes().find(way.handles[i])->frame; };
    ASSERT_EQ(way.graph.list_loops(0, listed), 3U);
    EXPECT_EQ(listed[0].older_id, frame(2));
    EXPECT_EQ(listed[0].newer_id, frame(9));
    EXPECT_EQ(listed[0].shared_points, 7U);
    EXPECT_EQ(listed[0].kind, KeyframeLinkKind::kLoop);
    EXPECT_EQ(listed[2].newer_id, frame(8));
    EXPECT_EQ(listed[3].older_id, kNoKeyframe) << "written beyond the count";
    ASSERT_EQ(way.graph.list_loops(1, listed), 2U);
    EXPECT_EQ(listed[0].newer_id, frame(12));
    EXPECT_EQ(way.graph.list_loops(0, std::span(listed).first(2)), 2U);
    way.world.map.release_keyframe(way.handles[12]);
    ASSERT_EQ(way.graph.list_loops(0, listed), 2U);
    EXPECT_EQ(listed[1].newer_id, frame(8));
    way.graph.reset();
    EXPECT_EQ(way.graph.list_loops(0, listed), 0U);
}

// Promise: the tree may run against the order in which keyframes lie in memory and in time, as after one of them left
// and others were hung elsewhere; the loop is spread along the tree all the same, and what a child shares with a parent
// younger than itself is one edge, not two.
TEST(EssentialGraph, AParentMayBeYounger) {
    Way way;
    way.set_parent(3, 4);  // 0 1 2 4 3 5 6 ...
    way.set_parent(4, 2);
    way.set_parent(5, 3);
    way.share(3, 4, 60);
    way.add_loop();
    way.solve();
    const std::uint32_t order[] = {0, 1, 2, 4, 3, 5, 6, 7};
    const double usual_m = way.moved_m(9) - way.moved_m(10);
    EXPECT_GT(usual_m, 0.01);
    for (std::size_t i = 1; i < std::size(order); ++i) {
        const double step_m = way.moved_m(order[i - 1]) - way.moved_m(order[i]);
        EXPECT_NEAR(step_m / usual_m, order[i] == 3 ? 0.2 / 0.6 : 1.0, 0.01) << order[i];
    }
}

// Promise: a large map remembers no more loops than a middling one, and a map of nothing has room for one.
TEST(EssentialGraph, LoopsRememberedAreBounded) {
    EXPECT_EQ(EssentialGraph::loops_max(0), 1U);
    EXPECT_EQ(EssentialGraph::loops_max(kLoopLinksMax), kLoopLinksMax);
    EXPECT_EQ(EssentialGraph::loops_max(100'000), kLoopLinksMax);
}

}  // namespace
}  // namespace stillmesh::essential_graph_test
