#include "engine/adjust/pose_graph.hpp"

#include <gtest/gtest.h>

#include <bit>
#include <cmath>
#include <cstdint>
#include <vector>

#include "tests/adjust/graphs.hpp"
#include "tests/support/check_message.hpp"
#include "tests/support/memory.hpp"

namespace stillmesh::pose_graph_test {
namespace {

using test::Graph;
using test::GraphOptions;
using test::make_graph;
using Solver = test::InMemory<PoseGraph>;

double worst_off(const PoseGraph& solver, const std::vector<SE3>& truth) {
    double worst = 0;
    for (std::uint32_t i = 0; i < solver.nodes(); ++i) {
        worst = std::max(worst, std::sqrt(se3_log(truth[i].inverse() * solver.pose(i)).squaredNorm()));
    }
    return worst;
}

// Promise: the memory planned is the memory used.
TEST(PoseGraph, PlansWhatItTakes) {
    Solver solver(PoseGraphSizes{7, 31});
    EXPECT_EQ(solver.used_bytes(), solver.planned_bytes());
}

// Promise: edges without noise are met exactly, however far away the poses start.
TEST(PoseGraph, MeetsExactEdges) {
    GraphOptions options;
    options.has_noise = false;
    Graph graph = make_graph(options);
    Random random(5);
    for (std::size_t i = 1; i < graph.poses.size(); ++i) {
        graph.poses[i] = graph.poses[i] * test::draw_motion(random, 0.3, 0.2);
        renormalise(graph.poses[i].rotation);
    }
    Solver solver(graph.sizes());
    ASSERT_TRUE(graph.load(*solver));
    PoseGraphOptions exact;
    exact.cost_change_min = 1e-12;
    solver->start(exact);
    WorkBudget budget(UINT32_MAX);
    ASSERT_EQ(solver->step(budget), Progress::kDone);
    EXPECT_TRUE(solver->summary().has_converged);
    EXPECT_GT(solver->summary().initial_cost, 1.0);
    EXPECT_LT(worst_off(*solver, graph.true_poses), 1e-7);
}

// Promise: coming home takes the drift away, within a few iterations whatever the length of the lap.
TEST(PoseGraph, ALoopTakesTheDriftAway) {
    for (const std::uint32_t nodes : {30U, 100U, 250U}) {
        GraphOptions options;
        options.nodes = nodes;
        options.neighbours = 1;
        options.sigma_rad = 0.002;
        options.seed = nodes;
        const Graph graph = make_graph(options);
        Solver solver(graph.sizes());
        ASSERT_TRUE(graph.load(*solver));
        solver->start(PoseGraphOptions{});
        WorkBudget budget(UINT32_MAX);
        ASSERT_EQ(solver->step(budget), Progress::kDone);
        double before = 0, after = 0;
        for (std::uint32_t i = 0; i < nodes; ++i) {
            before += (graph.poses[i].translation - graph.true_poses[i].translation).squaredNorm();
            after += (solver->pose(i).translation - graph.true_poses[i].translation).squaredNorm();
        }
        EXPECT_LT(after, 0.5 * before) << nodes;
        EXPECT_TRUE(solver->summary().has_converged);
        EXPECT_LE(solver->summary().inner_iterations, 40U) << nodes;  // block-Jacobi: hundreds
    }
}

// Promise: any slicing gives the same bits, no slice overdraws by more than the stated ceiling, and the first node
// stays where it is to the bit.
TEST(PoseGraph, AnySlicingGivesTheSameBits) {
    GraphOptions options;
    options.nodes = 70;
    options.loops = 3;
    const Graph graph = make_graph(options);
    Solver solver(graph.sizes());
    std::vector<std::uint64_t> wanted;
    for (const std::uint32_t slice : {UINT32_MAX, 1U, 13U, 100U, 4999U}) {
        ASSERT_TRUE(graph.load(*solver));
        solver->start(PoseGraphOptions{});
        for (;;) {
            WorkBudget budget(slice);
            const Progress progress = solver->step(budget);
            EXPECT_LT(budget.units_spent(), std::uint64_t{slice} + PoseGraph::kPieceUnitsMax);
            if (progress == Progress::kDone) break;
            ASSERT_EQ(progress, Progress::kWorking);
        }
        std::vector<std::uint64_t> bits;
        for (std::uint32_t i = 0; i < solver->nodes(); ++i) {
            for (int k = 0; k < 9; ++k) {
                bits.push_back(std::bit_cast<std::uint64_t>(solver->pose(i).rotation(k / 3, k % 3)));
            }
            for (int k = 0; k < 3; ++k) bits.push_back(std::bit_cast<std::uint64_t>(solver->pose(i).translation(k)));
        }
        bits.push_back(solver->summary().units);
        if (wanted.empty()) wanted = bits;
        ASSERT_EQ(bits, wanted) << slice;
        EXPECT_EQ(se3_log(solver->pose(0)).squaredNorm(), se3_log(graph.poses[0]).squaredNorm());
    }
}

// Promise: no work without a job; empty graphs and graphs without edges are done at once and change nothing.
TEST(PoseGraph, NothingToSolve) {
    Solver solver(PoseGraphSizes{3, 2});
    WorkBudget idle(100);
    EXPECT_EQ(solver->step(idle), Progress::kIdle);
    EXPECT_EQ(idle.units_spent(), 0U);
    solver->start(PoseGraphOptions{});
    EXPECT_TRUE(solver->is_done());
    solver->begin();
    SE3 pose;
    pose.translation.x() = 3;
    ASSERT_TRUE(solver->add_node(SE3{}, PoseGraph::kNoParent).is_ok());
    ASSERT_TRUE(solver->add_node(pose, 0).is_ok());
    solver->start(PoseGraphOptions{});
    EXPECT_TRUE(solver->is_done());
    EXPECT_EQ(solver->pose(1).translation.x(), 3.0);
}

// Promise: full says kFull, and what is not finite or has no weight is refused.
TEST(PoseGraph, RefusesWhatItCannotUse) {
    Solver solver(PoseGraphSizes{2, 1});
    SE3 nan;
    nan.translation.y() = std::nan("");
    EXPECT_EQ(solver->add_node(nan, PoseGraph::kNoParent).status(), Status::kInvalid);
    ASSERT_TRUE(solver->add_node(SE3{}, PoseGraph::kNoParent).is_ok());
    ASSERT_TRUE(solver->add_node(SE3{}, 0).is_ok());
    EXPECT_EQ(solver->add_node(SE3{}, 0).status(), Status::kFull);
    EXPECT_EQ(solver->add_edge({0, 0, SE3{}, 1, 1}), Status::kInvalid);
    EXPECT_EQ(solver->add_edge({0, 1, nan, 1, 1}), Status::kInvalid);
    EXPECT_EQ(solver->add_edge({0, 1, SE3{}, 0, 1}), Status::kInvalid);
    EXPECT_EQ(solver->add_edge({0, 1, SE3{}, 1, -1}), Status::kInvalid);
    EXPECT_EQ(solver->add_edge({0, 1, SE3{}, 1, 1}), Status::kOk);
    EXPECT_EQ(solver->add_edge({0, 1, SE3{}, 1, 1}), Status::kFull);
}

}  // namespace
}  // namespace stillmesh::pose_graph_test
