#include "engine/tasks/frame_view.hpp"

#include "engine/tasks/odometry.hpp"

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
        f.is_dynamic = true;
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

std::uint32_t list_keyframes(const Map& map, std::span<KeyframePose> out) noexcept {
    std::uint32_t count = 0;
    for (std::uint32_t slot = 0; slot < map.keyframes().slots_count() && count < out.size(); ++slot) {
        if (!map.keyframes().is_taken(slot)) continue;
        const Keyframe& keyframe = map.keyframes().at(slot);
        const Keyframe* const parent = map.keyframes().find(keyframe.parent);
        out[count++] = {keyframe.frame, parent != nullptr ? parent->frame : kNoKeyframe,
                        transform_of(keyframe.world_from_camera)};
    }
    return count;
}

void fill_map_statistics(const Map& map, EngineStatistics& statistics) noexcept {
    statistics.keyframes_forgotten = map.keyframes_forgotten();
    statistics.points_forgotten = map.points_forgotten();
    statistics.keyframes_evicted = map.statistics().keyframes_evicted;
    statistics.keyframes_redundant = map.statistics().keyframes_redundant;
    statistics.points_culled = map.statistics().points_culled;
    statistics.points_emptied = map.statistics().points_emptied;
    statistics.points_fused = map.statistics().points_fused;
    statistics.points_evicted = map.statistics().points_evicted;
    const auto pool_statistics = [](const auto& pool) {
        return PoolStatistics{static_cast<std::uint32_t>(pool.size()), static_cast<std::uint32_t>(pool.high_water()),
                              static_cast<std::uint32_t>(pool.capacity())};
    };
    statistics.keyframes = pool_statistics(map.keyframes());
    statistics.map_points = pool_statistics(map.points());
}

}  // namespace stillmesh
