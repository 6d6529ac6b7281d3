// What came into the room: new features at places that were empty when a keyframe saw a point behind them, known to
// stand still. However much of the picture it covers, such a thing was moved there, or moves; what stands still was
// there already, or where no keyframe looked. Limit: features_max features. Cost: for each keyframe of the local map
// one projection of each new feature, and one look at each of its points.
#pragma once

#include <cstdint>
#include <span>

#include "engine/matching/feature_grid.hpp"
#include "engine/matching/map_matcher.hpp"
#include "engine/tracking/point_judge.hpp"
#include "engine/world/world.hpp"

namespace stillmesh {

class FreeSpace {
public:
    static constexpr void plan(ArenaPlan& arena, const Limits& limits) noexcept {
        FeatureGrid::plan(arena, limits);
        arena.array<Place>(limits.features_max);
        arena.array<Votes>(limits.features_max);
    }
    void create(Arena& arena, const Limits& limits, const Parameters& configuration) noexcept;

    // Asks the keyframes of the local map about the frame's features that show no point yet.
    void ask(const PosedFrame& posed, const MapMatcher& matcher, const World& world) noexcept;
    // More points were seen behind this feature's place than at it, and so it is with a fifth of all: a few are the
    // edges of things that stand.
    [[nodiscard]] bool came(std::size_t feature) const noexcept { return has_come_ && was_empty(feature); }

private:
    // Of a feature, as a keyframe would see it.
    struct Place {
        float x = 0, y = 0;  // px, raw
        float z_m = 0;
        std::uint16_t feature = 0;
    };
    struct Votes {
        std::uint8_t behind = 0, there = 0;
    };
    [[nodiscard]] bool was_empty(std::size_t feature) const noexcept {
        return votes_[feature].behind > votes_[feature].there;
    }
    [[nodiscard]] bool is_witness(const MapPoint& point, const PosedFrame& posed) const noexcept;
    void ask_keyframe(const PosedFrame& posed, const MapMatcher& matcher, const World& world,
                      const Keyframe& keyframe) noexcept;
    void vote(const Observation& observation, const MeasuredFrame& frame) noexcept;

    const Parameters* parameters_ = nullptr;  // outlives it
    FeatureGrid grid_;
    std::span<Place> places_;
    std::span<Votes> votes_;  // by feature
    bool has_come_ = false;   // a body, by the share of what is new
};

}  // namespace stillmesh
