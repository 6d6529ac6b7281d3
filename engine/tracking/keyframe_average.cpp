#include "engine/tracking/keyframe_average.hpp"

#include <algorithm>

namespace stillmesh {

void KeyframeAverage::create(Arena& arena, const Limits& limits, const Parameters& configuration) noexcept {
    reach_ = configuration.map.averaged_reach;
    feature_ = arena.array<std::uint16_t>(limits.map_points_max);
}

void KeyframeAverage::begin(const Map& map, Handle<Keyframe> keyframe) noexcept {
    keyframe_ = keyframe;
    std::fill(feature_.begin(), feature_.end(), kNone);
    const std::span<const Observation> seen = map.observations(keyframe);
    for (std::size_t i = 0; i < seen.size(); ++i) {
        if (map.points().find(seen[i].point) != nullptr) feature_[seen[i].point.slot()] = static_cast<std::uint16_t>(i);
    }
}

void KeyframeAverage::add(std::span<const Correspondence> correspondences, std::span<const std::uint16_t> chosen,
                          const SE3& world_from_camera, Map& map) const noexcept {
    const Keyframe* const keyframe = map.keyframes().find(keyframe_);
    if (keyframe == nullptr) return;
    const SE3 keyframe_from_camera = keyframe->world_from_camera.inverse() * world_from_camera;
    const double moved_m2 = keyframe_from_camera.translation.squaredNorm();
    for (const std::uint16_t i : chosen) {
        const Correspondence& c = correspondences[i];
        const double reach_m = reach_ * c.p_camera.z();
        if (!c.has_depth || feature_[c.point_slot] == kNone || moved_m2 > reach_m * reach_m) continue;
        map.average(keyframe_, feature_[c.point_slot], map.points().handle_of(c.point_slot),
                    keyframe_from_camera * c.p_camera);
    }
}

}  // namespace stillmesh
