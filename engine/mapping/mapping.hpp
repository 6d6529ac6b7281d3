// Mapping (paper 2.1, local mapping): what happens to a new keyframe between frames, in slices. Its stages, one after
// the other, each resumable:
//   cull         points unseen for a second that move or were hardly ever seen
//   triangulate  points for features without depth, from the one or two best covisible keyframes
//   fuse         duplicates, and observations tracking missed, with the best covisible keyframes, both ways
//   adjust       bundle adjustment of a window: free keyframes, fixed neighbours, the static points they see;
//                not where the new keyframe sees few of them
//   commit       what was evicted or changed since is skipped; newer keyframes follow their parent in the spanning
//                tree, other points their reference keyframe, the camera the newest keyframe
//   redundant    keyframes of the neighbourhood whose points are nearly all seen by three others
//   evict        room for the next keyframes, ahead of need (the policy stands in engine/map/eviction.hpp)
// Tracking never waits: a keyframe is part of the map when it is made; mapping refines it. The queue is bounded
// (World::kKeyframeQueueMax): a keyframe beyond it is not refined, and counted as refused.
// Units: a residual evaluated, 32 descriptors compared, or what takes as long. No piece takes more than
// piece_units_max(); the result does not depend on how the pieces are cut into slices.
#pragma once

#include <cstdint>
#include <span>

#include "engine/adjust/local_adjustment.hpp"
#include "engine/configuration.hpp"
#include "engine/mapping/point_fusion.hpp"
#include "engine/outputs.hpp"
#include "engine/schedule/task.hpp"
#include "engine/world/world.hpp"

namespace stillmesh {

class Mapping final : public Task {
public:
    enum class Stage : std::uint8_t {
        kIdle,
        kCull,
        kTriangulate,
        kFuse,
        kChoose,
        kCollect,
        kAdjust,
        kCommit,
        kRedundant,
        kEvict,
    };
    static constexpr std::uint32_t kWindowMax = 12;  // free keyframes
    static constexpr std::uint32_t kFixedMax = 24;

    static constexpr AdjustmentSizes sizes(const Limits& limits) noexcept {
        const std::uint32_t window = limits.keyframes_max < kWindowMax ? limits.keyframes_max : kWindowMax;
        const std::uint32_t fixed = limits.keyframes_max < kFixedMax ? limits.keyframes_max : kFixedMax;
        return {window, fixed, 2 * limits.features_max, 8 * limits.features_max};
    }
    static constexpr void plan(ArenaPlan& arena, const Limits& limits) noexcept {
        LocalAdjustment::plan(arena, sizes(limits));
        PointFusion::plan(arena, limits);
        arena.array<ProblemKeyframe>(sizes(limits).free_keyframes_max + sizes(limits).fixed_keyframes_max);
        arena.array<ProblemPoint>(2 * limits.features_max);
        arena.array<ProblemObservation>(8 * limits.features_max);
        arena.array<std::uint32_t>(limits.map_points_max);
        arena.array<std::uint16_t>(limits.keyframes_max);
    }
    void create(Arena& arena, World& world) noexcept;
    void reset() noexcept;

    [[nodiscard]] Progress step(WorkBudget& budget) noexcept override;
    // The most that one piece of work takes, and hence the most that a slice overdraws.
    [[nodiscard]] std::uint32_t piece_units_max() const noexcept { return piece_units_max_; }

    // For loop closing.
    [[nodiscard]] PointFusion& fusion() noexcept { return fusion_; }

    void fill(EngineStatistics& statistics) const noexcept;
    // Of the next piece: who measures what a piece takes wants to know.
    [[nodiscard]] Stage stage() const noexcept { return stage_; }

private:
    static constexpr std::uint32_t kNeighboursMax = 10;
    static constexpr std::uint32_t kNone = 0xffffffffU;

    struct ProblemKeyframe {
        Handle<Keyframe> handle;
        SE3 world_from_camera;  // when the problem was made
        std::uint32_t index = 0;
        bool is_fixed = false;
    };
    struct ProblemPoint {
        Handle<MapPoint> handle;
        double world[3] = {};
    };
    struct ProblemObservation {
        std::uint16_t keyframe = 0;  // in problem_keyframes_
        std::uint16_t feature = 0;
    };

    // One piece each: what it does, and the units it took.
    [[nodiscard]] std::uint32_t cull() noexcept;
    [[nodiscard]] std::uint32_t triangulate() noexcept;
    [[nodiscard]] std::uint32_t fuse() noexcept;
    [[nodiscard]] std::uint32_t choose_window() noexcept;
    [[nodiscard]] std::uint32_t collect() noexcept;
    [[nodiscard]] std::uint32_t commit() noexcept;
    [[nodiscard]] std::uint32_t drop_redundant() noexcept;
    [[nodiscard]] std::uint32_t evict() noexcept;

    [[nodiscard]] bool take() noexcept;
    void heed_correction() noexcept;
    void drop_adjustment() noexcept;
    void enter(Stage stage) noexcept;
    void find_neighbours() noexcept;
    void correct_keyframes() noexcept;
    void correct_points() noexcept;
    void drop_outliers() noexcept;

    World* world_ = nullptr;  // outlives it
    LocalAdjustment adjustment_;
    PointFusion fusion_;
    std::span<ProblemPoint> problem_points_;
    std::span<ProblemObservation> problem_observations_;
    std::span<std::uint32_t> problem_index_;  // by point slot: its index in the problem + 1
    std::span<std::uint16_t> counts_;         // by keyframe slot: observations of points of the problem
    std::span<ProblemKeyframe> problem_keyframes_;
    double readout_s_ = 0;  // of the map, when the window was chosen
    std::uint32_t problem_keyframe_count_ = 0;
    std::uint32_t problem_point_count_ = 0;
    std::uint32_t problem_observation_count_ = 0;
    Handle<Keyframe> neighbours_[kNeighboursMax];
    std::uint32_t neighbour_count_ = 0;
    Handle<Keyframe> keyframe_;  // at hand
    Stage stage_ = Stage::kIdle;
    std::uint32_t cursor_ = 0;  // in the stage
    std::uint32_t other_ = 0;   // neighbour, or pair of keyframes
    std::uint32_t free_count_ = 0;
    std::uint64_t corrections_seen_ = 0;  // of the whole map
    std::uint32_t piece_units_max_ = 0;
    MappingStatistics statistics_;
};

}  // namespace stillmesh
