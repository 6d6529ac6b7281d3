// How far two keyframes of the map can lie wrong to each other. Odometry gathers drift along its way, so that along the
// spanning tree the differences add up; but where a keyframe shares points with one of long ago (the camera came back,
// or was found again) the map itself says where both lie, and what odometry gathered in between no longer counts. That
// matters most after a loss: a camera that was carried can be anywhere, but once it is found the place four metres on
// that looks alike is as far away as ever. Cost: the keyframes above both in the tree.
#pragma once

#include <cstdint>

#include "engine/map/map.hpp"
#include "engine/parameters.hpp"

namespace stillmesh {

// Metres, for two keyframes of the map by slot.
[[nodiscard]] double drift_between(const Map& map, std::uint32_t slot_a, std::uint32_t slot_b,
                                   const LoopParameters& parameters) noexcept;

}  // namespace stillmesh
