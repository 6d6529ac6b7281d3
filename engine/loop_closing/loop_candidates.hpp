// Which of the places that look like a keyframe are worth verifying (method.md 9): they score like its neighbours, lie
// far from it in time, and each of the k queries before found the same place too. Limits: kHistoryMax places of a query
// are remembered, kCandidatesMax chosen. Cost: the bags of the neighbours, and every place compared with those of the
// queries before.
#pragma once

#include <cstdint>
#include <span>

#include "engine/recognition/place_search.hpp"
#include "engine/world/world.hpp"

namespace stillmesh {

class LoopCandidates {
public:
    static constexpr std::uint32_t kConsistencyMax = 5;  // queries before
    static constexpr std::uint32_t kHistoryMax = 24;     // places of one query that later ones are compared with
    static constexpr std::uint32_t kCandidatesMax = 3;

    // `keyframes_max`: of the limits, or 0 where a map is too small for loops.
    static constexpr void plan(ArenaPlan& arena, std::uint32_t keyframes_max) noexcept {
        arena.array<Places>(keyframes_max > 0 ? kConsistencyMax : 0U);
    }
    void create(Arena& arena, World& world, PlaceSearch& places, std::uint32_t keyframes_max) noexcept;
    void reset() noexcept;

    // Of what the query at hand found for `keyframe`, the best first; none while `is_resting`, but what was found is
    // remembered. Units.
    [[nodiscard]] std::uint32_t choose(Handle<Keyframe> keyframe, bool is_resting) noexcept;
    [[nodiscard]] std::span<const Handle<Keyframe>> chosen() const noexcept { return {chosen_, chosen_count_}; }

private:
    struct Places {
        Handle<Keyframe> keyframes[kHistoryMax];
        std::uint32_t count = 0;
    };
    [[nodiscard]] bool is_near(Handle<Keyframe> a, Handle<Keyframe> b) const noexcept;
    [[nodiscard]] bool is_consistent(Handle<Keyframe> place) const noexcept;
    [[nodiscard]] bool is_new(Handle<Keyframe> place) const noexcept;

    World* world_ = nullptr;  // this and the search outlive it
    PlaceSearch* places_ = nullptr;
    std::span<Places> history_;  // the last queries, the newest first
    std::uint32_t history_count_ = 0;
    Handle<Keyframe> chosen_[kCandidatesMax];
    std::uint32_t chosen_count_ = 0;
};

}  // namespace stillmesh
