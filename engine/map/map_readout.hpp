// The map as programs see it: where its keyframes lie, how full its pools are, and what went from it and why. Cost: one
// pass over the keyframes, where nothing else is said.
#pragma once

#include <cstdint>
#include <span>

#include "engine/map/map.hpp"
#include "engine/outputs.hpp"

namespace stillmesh {

// As many as there are and fit; how many.
[[nodiscard]] std::uint32_t list_keyframes(const Map& map, std::span<KeyframePose> out) noexcept;
// Each keyframe, in the order of slots, with the older ones that it shares most points with, at most `of_each` and not
// below map.shared_min; of equals always the same. As many as fit; how many. Cost: keyframes^2 comparisons, and of_each
// for each that is better than one chosen before.
[[nodiscard]] std::uint32_t list_covisible(const Map& map, std::uint32_t of_each, std::span<KeyframeLink> out) noexcept;
// How full its pools are, and what went from it and why.
void fill_map_statistics(const Map& map, EngineStatistics& statistics) noexcept;

}  // namespace stillmesh
