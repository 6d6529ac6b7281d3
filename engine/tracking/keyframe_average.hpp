// The newest keyframe's measurements become the means of what the frames near it saw. The adjustment has only keyframes
// to go by while tracking's filter has every frame: with a camera that hardly moves the map would be known worse after
// an adjustment than before (docs/mapping.md). From near by the pose between the two frames, known from hundreds of
// points, takes a look over without adding to its error.
// Limits: a number per map point. Cost: one product with a pose per static point.
#pragma once

#include <cstdint>
#include <span>

#include "engine/base/arena.hpp"
#include "engine/limits.hpp"
#include "engine/map/map.hpp"
#include "engine/matching/correspondence.hpp"
#include "engine/parameters.hpp"

namespace stillmesh {

class KeyframeAverage {
public:
    static constexpr void plan(ArenaPlan& arena, const Limits& limits) noexcept {
        arena.array<std::uint16_t>(limits.map_points_max);
    }
    void create(Arena& arena, const Limits& limits, const Parameters& configuration) noexcept;
    void reset() noexcept { keyframe_ = {}; }

    // From now on it is this keyframe, which has just been made.
    void begin(const Map& map, Handle<Keyframe> keyframe) noexcept;
    // What a frame at `world_from_camera` saw of its points; `chosen` among the correspondences stand still.
    void add(std::span<const Correspondence> correspondences, std::span<const std::uint16_t> chosen,
             const SE3& world_from_camera, Map& map) const noexcept;

private:
    static constexpr std::uint16_t kNone = 0xffffU;

    double reach_ = 0;
    Handle<Keyframe> keyframe_;         // null or stale: none
    std::span<std::uint16_t> feature_;  // by point slot: which feature of the keyframe showed it at first, or kNone
};

}  // namespace stillmesh
