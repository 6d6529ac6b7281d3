// A map file back into a map: all of it is checked first, and nothing is touched unless all of it is right. Depth
// images beyond the limits are left out (map_file.hpp says which). Cost: two passes over the file. Limit: the engine's
// limits, compared before anything is counted by.
#pragma once

#include <span>

#include "engine/map/depth_images.hpp"
#include "engine/map/map.hpp"
#include "engine/record/map_copy.hpp"
#include "engine/record/map_file.hpp"

namespace stillmesh {

// Of the map only the scratch is used.
//   kNotFound, kEnd, kInvalid, kCorrupt, kFull (larger than the limits): `problem` says what
[[nodiscard]] Status check_map_file(std::span<const std::byte> bytes, const Limits& limits, const MapOrigin& origin,
                                    Map& map, MapFileInfo& info, MapFileProblem& problem) noexcept;
// The map that a checked file holds, in place of what was there. The n-th of its keyframes and points gets slot n.
void restore_map(std::span<const std::byte> bytes, const MapFileInfo& info, Map& map) noexcept;
// Its depth images, for a map that was just restored, in place of what was there.
void restore_depth_images(std::span<const std::byte> bytes, const MapFileInfo& info, const Map& map,
                          DepthImages& images) noexcept;
// What the numbers of a second map follow on.
struct MapEnd {
    std::uint64_t frames = 0;
    std::int64_t time_ns = 0;
};
// The map that a checked file holds behind one that was just restored, which there is room for: in slots, frames and
// times behind its own, expressed with its readout, in coordinates of its own, with a root of its own.
void append_map(std::span<const std::byte> bytes, const MapFileInfo& info, const MapEnd& end, Map& map) noexcept;
// Its depth images beside those of the first, for a map that was just appended and lies where it is to lie: where both
// are more than there is room for, DepthImages::join() says which stay.
void append_depth_images(std::span<const std::byte> bytes, const MapFileInfo& info, const MapEnd& end, const Map& map,
                         DepthImages& images) noexcept;

}  // namespace stillmesh
