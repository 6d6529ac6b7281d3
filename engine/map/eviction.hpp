// What a full map forgets, and in which order.
//   points     first what moves or has hardly ever been seen; then, of the others, what a keyframe has above its share
//              of the pool and what no keyframe observes; then the rest. Each of them the least recently seen first.
//   keyframes  of those used least recently the newer of the two nearest to each other, so that the places of a long
//              way stay known, ever farther apart; and, while there is room yet, those that others make redundant.
// Among people most of what a keyframe adds is theirs: left in as long as the rest, it would turn the pool over within
// seconds. And a place must be recognised after a long way: without shares the oldest keyframes of a full pool had no
// points left at all. What goes is counted in MapStatistics. Cost: stated at each function.
#pragma once

#include <cstdint>
#include <span>

#include "engine/map/map.hpp"

namespace stillmesh {

// Keyframes compared with each other by evict_keyframe().
inline constexpr std::uint32_t kCrowdedCandidates = 64;

// Points that must not go: those whose mark (by slot) is this one; no marks spare none.
struct SparedPoints {
    std::span<const std::uint8_t> marks;
    std::uint8_t mark = 0;
    [[nodiscard]] bool has(std::uint32_t slot) const noexcept { return !marks.empty() && marks[slot] == mark; }
};

// Forgets `count` points in the order above (ties: the lower slot); weak ones go although they are spared, those seen
// in `frame` or later stay. Returns how many went. Cost: the pool twice.
std::uint32_t make_room_for_points(Map& map, std::uint32_t count, std::uint64_t frame,
                                   const SparedPoints& spared) noexcept;
// Forgets points that are not worth keeping: unseen for some frames, and moving or hardly ever seen before. Slots from
// `first`, at most `count`; returns the slot to go on with, 0 when the pool is through.
std::uint32_t cull_points(Map& map, std::uint64_t frame, std::uint32_t first, std::uint32_t count) noexcept;
void cull_points(Map& map, std::uint64_t frame) noexcept;

// Makes room for one keyframe, of those that are neither `spared` (by slot; may be empty) nor the newest: among the
// kCrowdedCandidates least recently useful the newer of the two nearest to each other; if all are far apart, the least
// recently useful. False: there is none. Cost: kCrowdedCandidates^2 / 2 distances, the features of two keyframes, and
// Map::release_keyframe().
[[nodiscard]] bool evict_keyframe(Map& map, std::span<const std::uint8_t> spared) noexcept;
// The oldest goes (sliding set).
void evict_oldest(Map& map) noexcept;
// Nearly all (redundant_permille) of its static points have enough other observers at the same or a finer scale.
[[nodiscard]] bool is_redundant(const Map& map, Handle<Keyframe> keyframe) noexcept;
void release_redundant(Map& map, Handle<Keyframe> keyframe) noexcept;

}  // namespace stillmesh
