// Where the 256 tests of a descriptor look: pairs of points in a disc of radius 15 around a corner, turned beforehand
// to each of kPatternTurns orientations. Constant data, 32 KiB, no work at start.
#pragma once

#include <cstdint>

namespace stillmesh {

inline constexpr std::uint32_t kDescriptorTests = 256;
inline constexpr std::uint32_t kPatternTurns = 32;

// Turn t is the pattern rotated by t * 2 pi / kPatternTurns, from x towards y, each point rounded to the nearest pixel.
// Points 2i and 2i + 1 are those of test i: (dx, dy).
struct TurnedPattern {
    std::int8_t points[kPatternTurns][2 * kDescriptorTests][2];
};
[[nodiscard]] const TurnedPattern& turned_pattern() noexcept;

}  // namespace stillmesh
