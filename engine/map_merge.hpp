// Two maps of one place become one. The engine holds the first, loaded and not used yet; the second comes as the bytes
// of its file. Where both show the same place is found by words and verified by geometry, keyframe by keyframe; what
// cannot be told from a place that looks alike is refused. Then the second map moves as one body, is numbered behind
// the first, hangs below it in the spanning tree, and points that both have become one. What is left of both maps'
// drift goes when the engine is given background work: loop closing looks every keyframe up, and all of it is adjusted
// once. Depth images of both stay, each where its keyframe lies; if there are too many, of the two nearest to each
// other the one goes that has a third nearest to it. For tools: it takes some milliseconds a keyframe.
#pragma once

#include <cstdint>
#include <span>

#include "engine/base/api.hpp"
#include "engine/base/status.hpp"
#include "engine/geometry/rigid_transform.hpp"
#include "engine/limits.hpp"
#include "engine/record/map_file.hpp"

namespace stillmesh {

class Engine;

// What came of it, joined or not.
struct MapMerge {
    std::uint32_t keyframes = 0;     // of the second map
    std::uint32_t found = 0;         // of them, that look like a place of the first
    std::uint32_t agreeing = 0;      // of them, whose place is where the second map as a whole would lie
    bool is_alike = false;           // enough agree, but too much looks alike to be sure
    double elsewhere_share = 0;      // how much other places of the first look like them, of how much that one does
    RigidTransform map_from_second;  // where it would lie; nothing where none was found
    std::uint32_t points_fused = 0;  // by those keyframes alone
};

// The engine must have a vocabulary and a map that was loaded, and not have been given a frame since.
//   kOk           joined: step() it until kIdle, then copy the map
//   kUnavailable  no vocabulary, or no map that was just loaded: nothing changed
//   kFull, kInvalid, kCorrupt, kEnd
//                 the file is none for this engine, or both together are more than the limits: `problem` says what,
//                 nothing changed
//   kNotFound     no place that both show for certain; the engine has forgotten its map
[[nodiscard]] STILLMESH_API Status merge_map(Engine& engine, std::span<const std::byte> second, MapFileProblem& problem,
                                             MapMerge& merge, std::uint8_t extractor = 0) noexcept;
// Forgets, in the order in which full pools do, what a map has above keyframes_max, map_points_max and depth_images_max
// of these; the newest keyframe stays. Depth images of a keyframe that goes, go with it.
STILLMESH_API void fit_map(Engine& engine, const Limits& limits) noexcept;

}  // namespace stillmesh
