// One number over everything each adjustment computes, units of work included, as in tests/geometry/golden_test.cpp:
// the other tests of this room ask for the right minimum, which is found by a wrong derivative, too, only later.
// Whoever changes a formula changes the number, and says so in the commit.
#include <gtest/gtest.h>

#include "engine/base/hash.hpp"
#include "tests/adjust/global_window.hpp"
#include "tests/adjust/graphs.hpp"
#include "tests/adjust/window.hpp"
#include "tests/support/memory.hpp"

namespace stillmesh::golden_test {
namespace {

void add(const SE3& pose, StateHash& hash) {
    for (int i = 0; i < 9; ++i) hash.add(pose.rotation(i / 3, i % 3));
    for (int i = 0; i < 3; ++i) hash.add(pose.translation(i));
}

template <typename Job>
void add_bundle(const Job& job, StateHash& hash) {
    for (std::uint32_t i = 0; i < job.keyframes(); ++i) add(job.pose(i), hash);
    for (std::uint32_t i = 0; i < job.points(); ++i)
        for (int k = 0; k < 3; ++k) hash.add(job.point(i)(k));
    hash.add(job.summary().initial_cost);
    hash.add(job.summary().final_cost);
    hash.add(job.summary().iterations);
    hash.add(job.summary().steps_accepted);
    hash.add(job.summary().points_used);
    hash.add(job.summary().units);
}

// Good starts, and such that steps are refused; all with depth, some, none; points that nobody can move; outliers.
test::Window window_of(std::uint32_t i) {
    test::WindowOptions options;
    options.seed = i;
    options.depth_share = i % 3 == 0 ? 1.0 : i % 3 == 1 ? 0.5 : 0.0;
    options.outlier_share = i % 2 == 0 ? 0.1 : 0.0;
    options.start_off_m = i % 5 == 4 ? 0.5 : 0.03;
    options.start_off_rad = i % 5 == 4 ? 0.3 : 0.02;
    options.free = 2 + i;
    options.fixed = i % 4 == 3 ? 0 : 2;
    options.observations = i % 4 == 2 ? 200 : 500;
    return test::make_window(options);
}

constexpr std::uint32_t kWindows = 10;

// Promise: local adjustment gives the same bits on every processor, compiler and optimisation level, for the same work.
TEST(LocalAdjustment, GoldenBits) {
    StateHash hash;
    for (std::uint32_t i = 0; i < kWindows; ++i) {
        const test::Window window = window_of(i);
        test::InMemory<LocalAdjustment> adjustment(window.sizes());
        ASSERT_TRUE(window.load(*adjustment));
        adjustment->start(AdjustmentOptions{});
        ASSERT_EQ(test::run_to_end(*adjustment), Progress::kDone);
        add_bundle(*adjustment, hash);
        hash.add(static_cast<std::uint32_t>(adjustment->summary().outcome));
        hash.add(adjustment->summary().first_round_cost);
        hash.add(adjustment->summary().outliers);
        for (std::uint32_t o = 0; o < adjustment->observations(); ++o) hash.add(adjustment->chi2(o));
    }
    EXPECT_EQ(hash.value(), 0x89dd4bd57629a6daULL) << std::hex << hash.value();
}

// Promise: so does global adjustment.
TEST(GlobalAdjustment, GoldenBits) {
    StateHash hash;
    for (std::uint32_t i = 0; i < kWindows; ++i) {
        const test::Window window = window_of(i);
        test::InMemory<GlobalAdjustment> adjustment(test::global_sizes(window));
        ASSERT_TRUE(test::load(window, *adjustment));
        adjustment->start(GlobalOptions{});
        WorkBudget budget(UINT32_MAX);
        ASSERT_EQ(adjustment->step(budget), Progress::kDone);
        add_bundle(*adjustment, hash);
        hash.add(adjustment->summary().inner_iterations);
        hash.add(adjustment->summary().observations);
    }
    EXPECT_EQ(hash.value(), 0x3f6f96dd68318331ULL) << std::hex << hash.value();
}

// Promise: so does the pose graph.
TEST(PoseGraph, GoldenBits) {
    StateHash hash;
    for (std::uint32_t i = 0; i < 8; ++i) {
        test::GraphOptions options;
        options.nodes = 10 + 9 * i;
        options.neighbours = 1 + i % 4;
        options.loops = i % 3;
        options.seed = i;
        test::Graph graph = test::make_graph(options);
        Random random(i);
        for (std::size_t n = 1; i % 2 == 1 && n < graph.poses.size(); ++n) {
            graph.poses[n] = graph.poses[n] * test::draw_motion(random, 0.8, 0.6);
            renormalise(graph.poses[n].rotation);
        }
        if (i == 5) graph.parents[7] = PoseGraph::kNoParent;  // holds still
        test::InMemory<PoseGraph> solver(graph.sizes());
        ASSERT_TRUE(graph.load(*solver));
        solver->start(PoseGraphOptions{});
        WorkBudget budget(UINT32_MAX);
        ASSERT_EQ(solver->step(budget), Progress::kDone);
        for (std::uint32_t n = 0; n < solver->nodes(); ++n) add(solver->pose(n), hash);
        hash.add(solver->summary().initial_cost);
        hash.add(solver->summary().final_cost);
        hash.add(solver->summary().iterations);
        hash.add(solver->summary().steps_accepted);
        hash.add(solver->summary().inner_iterations);
        hash.add(solver->summary().units);
    }
    EXPECT_EQ(hash.value(), 0x79f1e7c809fbba78ULL) << std::hex << hash.value();
}

}  // namespace
}  // namespace stillmesh::golden_test
