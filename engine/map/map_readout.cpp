#include "engine/map/map_readout.hpp"

#include <algorithm>

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

std::uint32_t list_covisible(const Map& map, std::uint32_t of_each, std::span<KeyframeLink> out) noexcept {
    const Pool<Keyframe>& keyframes = map.keyframes();
    const std::uint32_t shared_min = std::max(map.parameters().shared_min, 1U);
    std::uint32_t count = 0;
    for (std::uint32_t slot = 0; slot < keyframes.slots_count(); ++slot) {
        if (!keyframes.is_taken(slot)) continue;
        const std::uint64_t newer = keyframes.at(slot).frame;
        const auto room = out.subspan(count, std::min<std::size_t>(of_each, out.size() - count));
        const auto fewer = [](const KeyframeLink& a, const KeyframeLink& b) {
            return a.shared_points < b.shared_points;
        };
        std::size_t chosen = 0;
        std::uint32_t enough = shared_min;  // points that are worth a place
        for (std::uint32_t other = 0; other < keyframes.slots_count() && !room.empty(); ++other) {
            const std::uint32_t shared = map.shared(slot, other);
            if (shared < enough || keyframes.at(other).frame >= newer) continue;
            const bool is_full = chosen == room.size();
            KeyframeLink& place = is_full ? *std::min_element(room.begin(), room.end(), fewer) : room[chosen++];
            place = {keyframes.at(other).frame, newer, shared, KeyframeLinkKind::kCovisible};
            if (chosen == room.size()) enough = std::min_element(room.begin(), room.end(), fewer)->shared_points + 1;
        }
        count += static_cast<std::uint32_t>(chosen);
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
