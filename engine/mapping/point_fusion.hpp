// The same place twice in the map: a static point is projected into a keyframe that missed it. Where a feature there
// looks alike and has no point, the point is observed by that keyframe too; where it has one at the same place, as far
// as the two are known, the two become one, the older. Mapping asks it of neighbours, loop closing of what met again.
// Limits: features_max features. Cost: some four units a point; pointing it at another keyframe one unit for 8
// features.
#pragma once

#include <cstdint>

#include "engine/base/arena.hpp"
#include "engine/base/fixed_vector.hpp"
#include "engine/geometry/camera.hpp"
#include "engine/limits.hpp"
#include "engine/map/map.hpp"
#include "engine/matching/feature_grid.hpp"
#include "engine/parameters.hpp"
#include "engine/world/world.hpp"

namespace stillmesh {

class PointFusion {
public:
    static constexpr void plan(ArenaPlan& arena, const Limits& limits) noexcept { FeatureGrid::plan(arena, limits); }
    // The most that fuse() takes for one point.
    static constexpr std::uint32_t units_max(const Limits& limits) noexcept {
        return kObserversMax * limits.features_max / 64 + 8;
    }
    void create(Arena& arena, World& world) noexcept;

    // The keyframe that points are projected into. All three return the units it took.
    [[nodiscard]] bool has_target(Handle<Keyframe> keyframe) const noexcept { return target_ == keyframe; }
    [[nodiscard]] std::uint32_t set_target(Handle<Keyframe> keyframe) noexcept;
    void forget_target() noexcept { target_ = {}; }
    [[nodiscard]] std::uint32_t fuse(Handle<MapPoint> handle) noexcept;
    [[nodiscard]] std::uint32_t fuse_into(Handle<MapPoint> handle, Handle<Keyframe> keyframe) noexcept;

private:
    static constexpr std::uint32_t kObserversMax = 16;  // a point with more stays: its fusion would be a long piece
    static constexpr std::uint32_t kNone = 0xffffffffU;

    // In the target, around the projection `pixel` of a point `z_m` away: the feature that is most alike, or kNone.
    [[nodiscard]] std::uint32_t find_alike(const MapPoint& point, const Vector2& pixel, double z_m) const noexcept;

    World* world_ = nullptr;  // outlives it
    Handle<Keyframe> target_;
    FeatureGrid grid_;  // of its observations
};

}  // namespace stillmesh
