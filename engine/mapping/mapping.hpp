// Mapping (paper 2.1, local mapping): what happens to a new keyframe between frames, in slices. Its stages, one after
// the other, each resumable:
//   cull       points unseen for a second that move or were hardly ever seen
//   adjust     bundle adjustment of a window around it (local_window.hpp): choose, collect, adjust, commit
//   redundant  keyframes of the neighbourhood whose points are nearly all seen by three others
//   evict      room for the next keyframes, ahead of need (the policy stands in engine/map/eviction.hpp)
// Tracking never waits: a keyframe is part of the map when it is made; mapping refines it. The queue is bounded
// (World::kKeyframeQueueMax): a keyframe beyond it is not refined, and counted as refused.
// Units: a residual evaluated, 32 descriptors compared, or what takes as long. No piece takes more than
// piece_units_max(); the result does not depend on how the pieces are cut into slices.
#pragma once

#include <cstdint>

#include "engine/mapping/local_window.hpp"
#include "engine/mapping/point_fusion.hpp"
#include "engine/schedule/task.hpp"
#include "engine/world/world.hpp"

namespace stillmesh {

class Mapping final : public Task {
public:
    enum class Stage : std::uint8_t {
        kIdle,
        kCull,
        kChoose,
        kCollect,
        kAdjust,
        kCommit,
        kRedundant,
        kEvict,
    };

    static constexpr void plan(ArenaPlan& arena, const Limits& limits) noexcept {
        LocalWindow::plan(arena, limits);
        PointFusion::plan(arena, limits);
    }
    void create(Arena& arena, World& world) noexcept;
    void reset() noexcept;

    [[nodiscard]] Progress step(WorkBudget& budget) noexcept override;
    // The most that one piece of work takes, and hence the most that a slice overdraws.
    [[nodiscard]] std::uint32_t piece_units_max() const noexcept { return piece_units_max_; }

    // For loop closing.
    [[nodiscard]] PointFusion& fusion() noexcept { return fusion_; }

    // Of the next piece, for measuring what each takes.
    [[nodiscard]] Stage stage() const noexcept { return stage_; }

private:
    static constexpr std::uint32_t kNeighboursMax = 10;

    // One piece each: what it does, and the units it took.
    [[nodiscard]] std::uint32_t cull() noexcept;
    [[nodiscard]] std::uint32_t drop_redundant() noexcept;
    [[nodiscard]] std::uint32_t evict() noexcept;

    [[nodiscard]] bool take() noexcept;
    void heed_correction() noexcept;
    void drop_adjustment() noexcept;
    void enter(Stage stage) noexcept;
    [[nodiscard]] std::uint32_t find_neighbours() noexcept;

    World* world_ = nullptr;  // outlives it
    LocalWindow window_;
    PointFusion fusion_;
    Handle<Keyframe> neighbours_[kNeighboursMax];
    std::uint32_t neighbour_count_ = 0;
    Handle<Keyframe> keyframe_;  // at hand
    Stage stage_ = Stage::kIdle;
    std::uint32_t cursor_ = 0;            // in the stage
    std::uint64_t corrections_seen_ = 0;  // of the whole map
    std::uint32_t piece_units_max_ = 0;
};

}  // namespace stillmesh
