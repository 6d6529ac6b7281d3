// Where the 256 tests of a descriptor look: pairs of points in a disc of radius 15 around a corner, turned beforehand
// to each of kPatternTurns orientations. Constant data, 32 KiB, no work at start. The tests were learned, see
// bench/features/learn_pattern.cpp.
#pragma once

#include <cstdint>

namespace stillmesh {

inline constexpr std::uint32_t kDescriptorTests = 256;
inline constexpr std::uint32_t kPatternTurns = 64;
// Half a circle is kept: the other half is the same points mirrored at the corner, that is, with negative offsets.
inline constexpr std::uint32_t kKeptTurns = kPatternTurns / 2;

// A turned point lies at most so far from the corner; the patch around it, 33 rows of 33, is copied to rows of 48.
inline constexpr std::int32_t kPatternRadius = 16;
inline constexpr std::int32_t kPatternPatchStride = 48;

// Turn t is the pattern rotated by t * 2 pi / kPatternTurns, from x towards y, each point rounded to the nearest pixel.
// Points 2i and 2i + 1 are those of test i, as offsets from the middle of the copied patch.
struct TurnedPattern {
    std::int16_t offsets[kKeptTurns][2 * kDescriptorTests];
};
[[nodiscard]] const TurnedPattern& turned_pattern() noexcept;

}  // namespace stillmesh
