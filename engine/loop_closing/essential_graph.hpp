// The essential graph (method.md 9): the pose graph over all keyframes that a loop is spread with. Its edges are the
// spanning tree, the loops measured so far, and strong covisibility; an edge of odometry is worth what the two
// keyframes share. Limits: keyframes_max nodes, edges_max() edges (weaker ones are left out), loops_max() loops (the
// oldest is forgotten). Cost: build() is one piece, build_units_max(); then that of the pose graph.
#pragma once

#include <cstdint>
#include <span>

#include "engine/adjust/pose_graph.hpp"
#include "engine/base/ring.hpp"
#include "engine/map/map_correction.hpp"
#include "engine/world/world.hpp"

namespace stillmesh {

class EssentialGraph {
public:
    static constexpr std::uint32_t loops_max(std::uint32_t keyframes_max) noexcept {
        return keyframes_max > kLoopLinksMax ? kLoopLinksMax : (keyframes_max > 0 ? keyframes_max : 1U);
    }
    static constexpr std::uint32_t edges_max(std::uint32_t keyframes_max) noexcept { return 6 * keyframes_max; }
    static constexpr std::uint32_t build_units_max(const Limits& limits) noexcept {
        return 24 * limits.keyframes_max + limits.keyframes_max * limits.keyframes_max / 64 + 1;
    }
    // `keyframes_max`: of the limits, or 0 where a map is too small for loops.
    static constexpr void plan(ArenaPlan& arena, std::uint32_t keyframes_max) noexcept {
        PoseGraph::plan(arena, {keyframes_max, edges_max(keyframes_max)});
        SolvedKeyframes::plan(arena, keyframes_max);
        Ring<Loop>::plan(arena, loops_max(keyframes_max));
    }
    void create(Arena& arena, World& world, std::uint32_t keyframes_max) noexcept;
    void reset() noexcept;

    // Two keyframes, the older first, were measured to lie so.
    void add_loop(Handle<Keyframe> a, Handle<Keyframe> b, const SE3& a_from_b) noexcept {
        loops_.push_over({a, b, a_from_b});
    }
    // Loops whose keyframes are both there, but the newest `pending`; the newest first, as many as fit. How many.
    [[nodiscard]] std::uint32_t list_loops(std::size_t pending, std::span<KeyframeLink> out) const noexcept;
    // Of the map as it is. Keyframes before `settled_end` (frame) lie right by loops closed before: what they share
    // across a long time counts. Units.
    [[nodiscard]] std::uint32_t build(std::uint64_t settled_end) noexcept;
    // kDone: this call solved it.
    [[nodiscard]] Progress step(WorkBudget& budget) noexcept { return graph_.step(budget); }
    // Keyframes go where the solution says.
    void move_keyframes() noexcept { nodes_.move(world_->map, world_->map_correction, graph_); }
    [[nodiscard]] const PoseGraphSummary& summary() const noexcept { return graph_.summary(); }

private:
    struct Loop {
        Handle<Keyframe> a, b;
        SE3 a_from_b;
    };
    [[nodiscard]] std::uint32_t add_nodes() noexcept;
    void add_tree() noexcept;
    void add_loops() noexcept;
    [[nodiscard]] std::uint32_t add_covisible(std::uint64_t settled_end) noexcept;
    void add_edge(std::uint32_t slot_a, std::uint32_t slot_b) noexcept;

    World* world_ = nullptr;  // outlives it
    PoseGraph graph_;
    SolvedKeyframes nodes_;
    Ring<Loop> loops_;
};

}  // namespace stillmesh
