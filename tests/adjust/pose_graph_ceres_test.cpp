// The same pose graphs solved by Ceres, dense, in a process of its own (ceres_pose_graph.cpp says what the file holds).
#include <gtest/gtest.h>

#include <cmath>
#include <cstdio>
#include <fstream>
#include <iomanip>
#include <string>
#include <vector>

#include "tests/adjust/graphs.hpp"
#include "tests/support/memory.hpp"
#include "tests/support/temporary_folder.hpp"

namespace stillmesh::pose_graph_ceres_test {
namespace {

void write_pose(std::ofstream& out, const SE3& pose) {
    for (int r = 0; r < 3; ++r) {
        for (int c = 0; c < 3; ++c) out << ' ' << pose.rotation(r, c);
    }
    for (int k = 0; k < 3; ++k) out << ' ' << pose.translation(k);
}

struct Solution {
    double cost = 0;
    std::vector<SE3> poses;
};

Solution solve_by_ceres(const test::Graph& graph, const std::string& name) {
    const test::TemporaryFolder folder;
    const std::string file = folder.path(name + ".pose_graph");
    {
        std::ofstream out(file);
        out << std::setprecision(17) << graph.poses.size() << ' ' << graph.edges.size() << '\n';
        for (std::size_t i = 0; i < graph.poses.size(); ++i) {
            out << (graph.parents[i] == PoseGraph::kNoParent ? 1 : 0);
            write_pose(out, graph.poses[i]);
            out << '\n';
        }
        for (const PoseGraphEdge& edge : graph.edges) {
            out << edge.a << ' ' << edge.b;
            write_pose(out, edge.a_from_b);
            out << ' ' << edge.info_translation << ' ' << edge.info_rotation << '\n';
        }
    }
    Solution solution;
    const std::string command = std::string(CERES_POSE_GRAPH) + " " + file;
    std::FILE* pipe = popen(command.c_str(), "r");
    EXPECT_NE(pipe, nullptr);
    if (pipe == nullptr) return solution;
    std::vector<double> numbers;
    double number = 0;
    while (std::fscanf(pipe, "%lf", &number) == 1) numbers.push_back(number);
    EXPECT_EQ(pclose(pipe), 0) << command;
    EXPECT_EQ(numbers.size(), 1 + 12 * graph.poses.size());
    if (numbers.size() != 1 + 12 * graph.poses.size()) return solution;
    const double* at = numbers.data();
    solution.cost = *at++;
    for (std::size_t i = 0; i < graph.poses.size(); ++i) {
        SE3 pose;
        for (int r = 0; r < 3; ++r) {
            for (int c = 0; c < 3; ++c) pose.rotation(r, c) = *at++;
        }
        for (int k = 0; k < 3; ++k) pose.translation(k) = *at++;
        solution.poses.push_back(pose);
    }
    return solution;
}

// Promise: the minimum of a drifted lap with loop edges is the dense reference solver's, poses and cost.
TEST(PoseGraphCeres, SameMinimum) {
    for (std::uint64_t seed = 1; seed <= 4; ++seed) {
        test::GraphOptions options;
        options.seed = seed;
        options.nodes = seed == 4 ? 200 : 40;
        options.loops = static_cast<std::uint32_t>(seed);
        const test::Graph graph = test::make_graph(options);
        test::InMemory<PoseGraph> solver(graph.sizes());
        ASSERT_TRUE(graph.load(*solver));
        PoseGraphOptions exact;
        exact.iterations_max = 100;
        exact.inner_iterations_max = 2000;
        exact.inner_residual_max = 1e-12;
        exact.cost_change_min = 1e-15;
        solver->start(exact);
        WorkBudget budget(UINT32_MAX);
        ASSERT_EQ(solver->step(budget), Progress::kDone);
        const Solution reference = solve_by_ceres(graph, "graph" + std::to_string(seed));
        ASSERT_EQ(reference.poses.size(), graph.poses.size());
        EXPECT_LT(std::abs(solver->summary().final_cost - reference.cost), 1e-9 * reference.cost);
        double worst = 0;
        for (std::uint32_t i = 0; i < solver->nodes(); ++i) {
            worst = std::max(worst, std::sqrt(se3_log(reference.poses[i].inverse() * solver->pose(i)).squaredNorm()));
        }
        EXPECT_LT(worst, 1e-6);
        std::printf("%zu nodes: cost %.9g from %.4g, Ceres %.9g, poses within %.2g; %u iterations, %u inner\n",
                    graph.poses.size(), solver->summary().final_cost, solver->summary().initial_cost, reference.cost,
                    worst, solver->summary().iterations, solver->summary().inner_iterations);
    }
}

}  // namespace
}  // namespace stillmesh::pose_graph_ceres_test
