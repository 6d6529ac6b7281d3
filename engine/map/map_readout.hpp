// The map as programs see it: where its keyframes lie, how full its pools are, and what went from it and why. Cost: one
// pass over the keyframes.
#pragma once

#include <cstdint>
#include <span>

#include "engine/map/map.hpp"
#include "engine/outputs.hpp"

namespace stillmesh {

// As many as there are and fit; how many.
[[nodiscard]] std::uint32_t list_keyframes(const Map& map, std::span<KeyframePose> out) noexcept;
// How full its pools are, and what went from it and why.
void fill_map_statistics(const Map& map, EngineStatistics& statistics) noexcept;

}  // namespace stillmesh
