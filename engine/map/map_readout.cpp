#include "engine/map/map_readout.hpp"

#include "engine/geometry/se3.hpp"

namespace stillmesh {

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
    static_cast<MapStatistics&>(statistics) = map.statistics();
    const auto pool_statistics = [](const auto& pool) {
        return PoolStatistics{static_cast<std::uint32_t>(pool.size()), static_cast<std::uint32_t>(pool.high_water()),
                              static_cast<std::uint32_t>(pool.capacity())};
    };
    statistics.keyframes = pool_statistics(map.keyframes());
    statistics.map_points = pool_statistics(map.points());
}

}  // namespace stillmesh
