// Every limit of the engine in one place: all memory follows from these numbers (bytes_needed in engine.hpp).
#pragma once

#include <cstdint>

namespace stillmesh {

struct Limits {
    std::uint32_t image_width_max = 640;         // px, at most 2047 (exact mesh predicates)
    std::uint32_t image_height_max = 480;        // px, at most 2047
    std::uint32_t pyramid_levels_max = 8;        // at most 12
    std::uint32_t features_max = 1000;           // per frame; more are never kept
    std::uint32_t keyframes_max = 256;           // full: the least useful is forgotten; at most 1024
    std::uint32_t map_points_max = 20000;        // full: each keyframe keeps its share
    std::uint32_t groups_max = 128;              // of the mesh; smaller ones beyond it stay without a weight
    std::uint32_t local_points_max = 9000;       // that a frame is matched against; farther ones are left out
    std::uint32_t vocabulary_words_max = 10000;  // a larger vocabulary is refused; at most 65535
    std::uint32_t store_features_max = 0;        // of a region of a map store; 0: no store
    std::uint32_t depth_images_max = 256;        // small ones, of keyframes; full: the oldest is forgotten; 0: none

    // The desk and the robot with memory to spare: at most 48 MiB.
    [[nodiscard]] static constexpr Limits room() noexcept { return {}; }
    // A small board: at most 8 MiB.
    [[nodiscard]] static constexpr Limits pocket() noexcept {
        return {640, 480, 8, 500, 40, 5500, 64, 3000, 10000, 0, 0};
    }
    // For tests: every full pool happens within seconds; at most 512 KiB.
    [[nodiscard]] static constexpr Limits tiny() noexcept { return {160, 120, 3, 100, 8, 262, 16, 200, 230, 0, 0}; }
};

// Calls visitor(name, value, min, max, unit, sentence) for every limit, as visit_parameters does for a configuration;
// value is a reference to std::uint32_t. The ranges are what handles, links and exact predicates can name; what limits
// ask of each other is in validate() (engine.hpp).
template <typename Visitor>
constexpr void visit_limits(Limits& l, Visitor&& v) {
    v("limits.image_width_max", l.image_width_max, 64.0, 2047.0, "px", "widest image");
    v("limits.image_height_max", l.image_height_max, 64.0, 2047.0, "px", "highest image");
    v("limits.pyramid_levels_max", l.pyramid_levels_max, 1.0, 12.0, "", "levels of the image pyramid");
    v("limits.features_max", l.features_max, 50.0, 16000.0, "", "features per frame");
    v("limits.keyframes_max", l.keyframes_max, 2.0, 1024.0, "", "keyframes of the map");
    v("limits.map_points_max", l.map_points_max, 50.0, 16777215.0, "", "points of the map, at least features_max");
    v("limits.groups_max", l.groups_max, 1.0, 65534.0, "", "groups of the mesh");
    v("limits.local_points_max", l.local_points_max, 1.0, 16777215.0, "", "points that a frame is matched against");
    v("limits.vocabulary_words_max", l.vocabulary_words_max, 2.0, 65535.0, "", "words of the vocabulary");
    v("limits.store_features_max", l.store_features_max, 0.0, 16000.0, "",
      "features of a region of the map store, 0: no store");
    v("limits.depth_images_max", l.depth_images_max, 0.0, 1024.0, "",
      "small depth images of keyframes, for a grid to drive in, 9.5 KiB each; 0: none");
}

}  // namespace stillmesh
