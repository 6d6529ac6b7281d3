// Pose graphs with known truth: a camera goes round a room, its odometry drifts, and it comes home.
#pragma once

#include <cstdint>
#include <vector>

#include "engine/adjust/pose_graph.hpp"
#include "engine/base/random.hpp"
#include "tests/adjust/window.hpp"

namespace stillmesh::test {

struct GraphOptions {
    std::uint32_t nodes = 40;
    std::uint32_t neighbours = 3;  // each node's edges to the ones before it
    std::uint32_t loops = 1;       // edges from the last nodes to the first
    double sigma_m = 0.01, sigma_rad = 0.005;
    bool has_noise = true;
    std::uint64_t seed = 1;
};

struct Graph {
    std::vector<SE3> poses, true_poses;  // initial: by odometry
    std::vector<std::uint32_t> parents;
    std::vector<PoseGraphEdge> edges;

    [[nodiscard]] PoseGraphSizes sizes() const {
        return {static_cast<std::uint32_t>(poses.size()), static_cast<std::uint32_t>(edges.size())};
    }
    [[nodiscard]] bool load(PoseGraph& graph) const {
        graph.begin();
        bool is_ok = true;
        for (std::size_t i = 0; i < poses.size(); ++i) is_ok &= graph.add_node(poses[i], parents[i]).is_ok();
        for (const PoseGraphEdge& edge : edges) is_ok &= graph.add_edge(edge) == Status::kOk;
        return is_ok;
    }
};

inline Graph make_graph(const GraphOptions& options) {
    Random random(options.seed);
    Graph out;
    const double step = 6.2831853 / options.nodes;
    SE3 pose;
    for (std::uint32_t i = 0; i < options.nodes; ++i) {
        out.true_poses.push_back(pose);
        Vector6 motion = Vector6::Zero();
        motion(2) = 0.2;
        motion(4) = step;
        pose = pose * se3_exp(motion) * draw_motion(random, 0.05, 0.05);
        renormalise(pose.rotation);
    }
    const auto measure = [&](std::uint32_t a, std::uint32_t b) {
        PoseGraphEdge edge;
        edge.a = a;
        edge.b = b;
        edge.a_from_b = out.true_poses[a].inverse() * out.true_poses[b];
        const double share = random.uniform(0.5, 2.0);
        if (options.has_noise) {
            Vector6 noise;
            for (int k = 0; k < 6; ++k)
                noise(k) = random.normal() * share * (k < 3 ? options.sigma_m : options.sigma_rad);
            edge.a_from_b = edge.a_from_b * se3_exp(noise);
            renormalise(edge.a_from_b.rotation);
        }
        edge.info_translation = 1.0 / (share * share * options.sigma_m * options.sigma_m);
        edge.info_rotation = 1.0 / (share * share * options.sigma_rad * options.sigma_rad);
        out.edges.push_back(edge);
    };
    out.poses.push_back(out.true_poses[0]);
    out.parents.push_back(PoseGraph::kNoParent);
    for (std::uint32_t i = 1; i < options.nodes; ++i) {
        measure(i - 1, i);
        out.poses.push_back(out.poses[i - 1] * out.edges.back().a_from_b);
        renormalise(out.poses.back().rotation);
        out.parents.push_back(i - 1);
        for (std::uint32_t k = 2; k <= options.neighbours && k <= i; ++k) {
            if (k % 2 == 0) {
                measure(i - k, i);
            } else {
                measure(i, i - k);
            }
        }
    }
    for (std::uint32_t i = 0; i < options.loops; ++i) measure(i, options.nodes - 1 - i);
    return out;
}

}  // namespace stillmesh::test
