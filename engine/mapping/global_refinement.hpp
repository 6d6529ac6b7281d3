// Global bundle adjustment after a loop (method.md 9): all keyframes and the static points that two of them see. It
// begins when a loop has corrected the map, works in slices on a copy, and moves the map in one step
// (engine/map/map_correction.hpp). Points that tracking has followed meanwhile stay where it has them beside their
// keyframe. Another loop drops it, and it begins anew. What it earns: docs/loops.md. Limits: sizes(); a small map has
// none, since a local window holds all of it. Units: a residual evaluated. No piece takes more than piece_units_max();
// the result does not depend on how the pieces are cut into slices.
#pragma once

#include <cstdint>
#include <span>

#include "engine/adjust/global_adjustment.hpp"
#include "engine/schedule/task.hpp"
#include "engine/world/world.hpp"

namespace stillmesh {

class GlobalRefinement final : public Task {
public:
    enum class Stage : std::uint8_t { kIdle, kKeyframes, kPoints, kReserve, kObservations, kAdjust, kCommit };

    static constexpr GlobalSizes sizes(const Limits& limits) noexcept {
        if (World::loop_keyframes_max(limits) == 0) return {};
        const std::uint64_t seen = std::uint64_t{limits.keyframes_max} * limits.features_max;
        const std::uint64_t usual = std::uint64_t{8} * limits.map_points_max;
        return {limits.keyframes_max, limits.map_points_max, static_cast<std::uint32_t>(seen < usual ? seen : usual)};
    }
    static constexpr void plan(ArenaPlan& arena, const Limits& limits) noexcept {
        GlobalAdjustment::plan(arena, sizes(limits));
        SolvedKeyframes::plan(arena, sizes(limits).keyframes_max);
        arena.array<std::uint32_t>(sizes(limits).points_max);
        arena.array<Handle<MapPoint>>(sizes(limits).points_max);
    }
    void create(Arena& arena, World& world) noexcept;
    void reset() noexcept;

    [[nodiscard]] Progress step(WorkBudget& budget) noexcept override;
    [[nodiscard]] std::uint32_t piece_units_max() const noexcept { return piece_units_max_; }
    [[nodiscard]] Stage stage() const noexcept { return stage_; }

private:
    void enter(Stage stage) noexcept;
    void heed_loops() noexcept;
    [[nodiscard]] std::uint32_t add_keyframes() noexcept;
    [[nodiscard]] std::uint32_t add_points() noexcept;
    [[nodiscard]] std::uint32_t add_observations(bool is_reserving) noexcept;
    void add_observation(std::uint32_t keyframe_slot, const Observation& o, bool is_reserving) noexcept;
    [[nodiscard]] std::uint32_t commit() noexcept;
    [[nodiscard]] bool adjusted_place(std::uint32_t slot, const MapPoint& point, Vector3& world) const noexcept;

    World* world_ = nullptr;  // outlives it
    GlobalAdjustment adjustment_;
    SolvedKeyframes keyframes_;
    std::span<std::uint32_t> index_;      // by point slot: its number in the adjustment + 1
    std::span<Handle<MapPoint>> points_;  // by number
    std::uint64_t since_frame_ = 0;       // when the copy was made
    std::uint64_t loops_seen_ = 0;
    Stage stage_ = Stage::kIdle;
    std::uint32_t cursor_ = 0;  // in the stage: a slot
    std::uint32_t piece_units_max_ = 0;
};

}  // namespace stillmesh
