// What a tracked frame adds to the state hash (engine/base/hash.hpp): pose and its covariance, matches with their
// groups and verdicts, decisions, and the hash of what changed in the map. Two builds that agree on it took the same
// way. Cost: one pass over the matches.
#pragma once

#include <cstdint>
#include <span>

#include "engine/base/hash.hpp"
#include "engine/geometry/se3.hpp"
#include "engine/map/map.hpp"
#include "engine/matching/correspondence.hpp"
#include "engine/outputs.hpp"
#include "engine/tracking/point_judge.hpp"

namespace stillmesh {

struct FrameOutcome {
    std::int64_t time_ns = 0;
    const SE3& world_from_camera;
    const PoseEstimate& pose;
    const FrameStatistics& statistics;
    std::span<const Correspondence> correspondences;
    std::span<const std::uint16_t> groups;  // by feature
    const PointJudge& judge;
};

void add_frame(const FrameOutcome& outcome, const Map& map, StateHash& hash) noexcept;

}  // namespace stillmesh
