// What a person may look at: the last frame's features with what became of them, its mesh, and the keyframes and
// numbers of the map. Nothing here is read by the engine. Limits: features_max features and the edges of their mesh.
// Cost: when it is asked for, one pass over features and edges.
#pragma once

#include <cstdint>
#include <span>

#include "engine/base/fixed_vector.hpp"
#include "engine/features/features.hpp"
#include "engine/matching/correspondence.hpp"
#include "engine/outputs.hpp"
#include "engine/static_region/static_region.hpp"

namespace stillmesh {

class FrameView {
public:
    static constexpr void plan(ArenaPlan& arena, const Limits& limits) noexcept {
        FixedVector<TrackedFeature>::plan(arena, limits.features_max);
        FixedVector<TrackedEdge>::plan(arena, mesh_edges_max(limits.features_max));
    }
    void create(Arena& arena, const Limits& limits) noexcept;

    // Borrowed until the next call. `groups`: by feature, kNoGroup for one in none; `chosen`: what the pose was
    // estimated from.
    [[nodiscard]] TrackingView show(std::span<const Keypoint> keypoints, std::span<const std::uint16_t> groups,
                                    std::span<const Correspondence> correspondences,
                                    std::span<const std::uint16_t> chosen, const StaticRegion& region) noexcept;

private:
    FixedVector<TrackedFeature> features_;
    FixedVector<TrackedEdge> edges_;
};

}  // namespace stillmesh
