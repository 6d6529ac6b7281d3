// Where a camera that lost its way in the map around it may be, by descriptors alone: one keyframe a frame is compared,
// in turn, and a pose on which enough of its points agree is proposed; tracking has the last word. Look-alikes are
// everywhere: a camera on a robot or in a hand gets only so far in the time. In a map from before it is not known where
// the camera was: more must agree. (A vocabulary finds the place among all keyframes at once: relocalisation.hpp.)
// Cost: features times observations of a keyframe, and one RANSAC.
#pragma once

#include <cstdint>
#include <span>

#include "engine/base/random.hpp"
#include "engine/map/map.hpp"
#include "engine/matching/correspondence.hpp"
#include "engine/parameters.hpp"

namespace stillmesh {

// So many times inliers_min must agree where nothing foretells the camera.
inline constexpr std::uint32_t kPlacedFactor = 3;

// Which of the map's keyframes to compare the next frame with, of a map that has some. The `turn`-th frame since the
// camera was lost, near the newest ones; in a map from before (`is_placed` false) all of them in turn.
[[nodiscard]] Handle<Keyframe> recovery_candidate(const Map& map, bool is_placed, std::uint64_t turn,
                                                  std::uint32_t keyframes_max) noexcept;

// Where the camera was when it was last measured, and how long ago; nullptr: in a map from before.
struct LastSeen {
    SE3 world_from_camera;
    double away_s = 0;
};
// A pose worth trying (world_from_camera), by the `chosen` of the matches with the candidate. kNotFound: there is none.
[[nodiscard]] Result<SE3> propose_recovery(std::span<const Correspondence> correspondences,
                                           std::span<const std::uint16_t> chosen, const LastSeen* last_seen,
                                           const Parameters& configuration, Random& random) noexcept;

}  // namespace stillmesh
