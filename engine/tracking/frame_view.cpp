#include "engine/tracking/frame_view.hpp"

namespace stillmesh {

void FrameView::create(Arena& arena, const Limits& limits) noexcept {
    features_.create(arena, limits.features_max);
    edges_.create(arena, mesh_edges_max(limits.features_max));
}

TrackingView FrameView::show(std::span<const Keypoint> keypoints, std::span<const std::uint16_t> groups,
                             std::span<const Correspondence> correspondences, std::span<const std::uint16_t> chosen,
                             const StaticRegion& region) noexcept {
    features_.clear();
    edges_.clear();
    for (std::size_t i = 0; i < keypoints.size(); ++i) {
        TrackedFeature f;
        f.x = keypoints[i].x;
        f.y = keypoints[i].y;
        if (groups[i] != kNoGroup) f.group = groups[i];
        STILLMESH_CHECK(features_.push(f));
    }
    for (const Correspondence& c : correspondences) {
        TrackedFeature& f = features_[c.feature];
        f.is_matched = true;
        f.is_dynamic = c.is_moving;
    }
    for (const std::uint16_t i : chosen) {
        TrackedFeature& f = features_[correspondences[i].feature];
        f.is_static = true;
        f.is_dynamic = false;
    }
    const Mesh& mesh = region.mesh();
    for (std::size_t i = 0; i < mesh.edges.size(); ++i) {
        const PixelPoint a = mesh.vertices[mesh.edges[i].a];
        const PixelPoint b = mesh.vertices[mesh.edges[i].b];
        constexpr float kScale = 1.0F / kMeshUnitsPerPixel;
        STILLMESH_CHECK(
            edges_.push({static_cast<float>(a.x) * kScale, static_cast<float>(a.y) * kScale,
                         static_cast<float>(b.x) * kScale, static_cast<float>(b.y) * kScale, region.is_kept(i)}));
    }
    return {features_.span(), edges_.span()};
}

}  // namespace stillmesh
