// Where features are of use: not where bodies move. A person at arm's length is printed with most corners of the
// picture; given out evenly by place, 850 of 1000 features lay on two people who covered 60 % of it, and 20 of the
// others had a vote. Cells of the picture in which nearly all that was matched moves are left a quarter of the features
// (OrbOptions::moving_permille), as long as there are corners elsewhere. Cost: one pass over the matches, 256 cells.
#pragma once

#include <cstdint>
#include <span>

#include "engine/features/features.hpp"
#include "engine/geometry/camera_model.hpp"
#include "engine/matching/correspondence.hpp"

namespace stillmesh {

// Cells with nothing but moving matches in and around them, or moving_per_still times as many as `still` ones (indices
// into `matches`, whose is_moving is known). Those move that lost their vote in earlier frames: where people who sway
// hold most features, a pose may go with them for a moment, and what it calls moving then is the room (sitting_rpy:19,
// .0289 for .0037).
[[nodiscard]] MovingCells moving_cells(const CameraModel& camera, std::span<const Keypoint> keypoints,
                                       std::span<const Correspondence> matches, std::span<const std::uint16_t> still,
                                       std::uint32_t moving_per_still) noexcept;

}  // namespace stillmesh
