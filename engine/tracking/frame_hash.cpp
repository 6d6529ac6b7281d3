#include "engine/tracking/frame_hash.hpp"

namespace stillmesh {

void add_frame(const FrameOutcome& outcome, const Map& map, StateHash& hash) noexcept {
    hash.add(static_cast<std::uint64_t>(outcome.time_ns));
    for (int i = 0; i < 3; ++i) hash.add(outcome.world_from_camera.translation(i));
    for (int i = 0; i < 9; ++i) hash.add(outcome.world_from_camera.rotation(i / 3, i % 3));
    hash.add(static_cast<std::uint32_t>(outcome.pose.state));
    hash.add(static_cast<std::uint32_t>(outcome.correspondences.size()));
    for (const Correspondence& c : outcome.correspondences) {
        hash.add(static_cast<std::uint64_t>(c.feature) << 32U | c.point_slot);
        const bool is_there = map.points().is_taken(c.point_slot);
        const std::uint64_t weight = is_there ? map.points().at(c.point_slot).weight_tenths : 0U;
        hash.add(static_cast<std::uint64_t>(c.distance_bits) << 40U | std::uint64_t{outcome.groups[c.feature]} << 16U |
                 weight << 8U | static_cast<std::uint64_t>(outcome.judge.verdict(c.feature)));
        if (is_there) hash.add(map.points().at(c.point_slot).world[2]);
    }
    for (const double number : outcome.pose.covariance) hash.add(number);
    hash.add(outcome.statistics.is_keyframe ? 1U : 0U);
    hash.add(map.points_forgotten());
    hash.add(map.changes_hash());
    hash.add(outcome.statistics.mesh_edges_kept);
    hash.add(static_cast<std::uint32_t>(map.points().size()));
}

}  // namespace stillmesh
