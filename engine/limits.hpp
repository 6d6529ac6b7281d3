// Every limit of the engine in one place: all memory follows from these numbers (bytes_needed in engine.hpp).
#pragma once

#include <cstdint>

namespace stillmesh {

struct Limits {
    std::uint32_t image_width_max = 640;    // px, at most 2047 (exact mesh predicates)
    std::uint32_t image_height_max = 480;   // px, at most 2047
    std::uint32_t pyramid_levels_max = 8;   // at most 12
    std::uint32_t features_max = 1000;      // per frame; more are never kept
    std::uint32_t keyframes_max = 256;      // full: the least useful is forgotten (engine/map/map.hpp); at most 1024
    std::uint32_t map_points_max = 20000;   // full: the least recently seen are forgotten
    std::uint32_t groups_max = 128;         // of the mesh; smaller ones beyond it stay without a vote
    std::uint32_t local_points_max = 6000;  // that a frame is matched against; farther ones are left out

    // The desk and the robot with memory to spare: at most 48 MiB.
    [[nodiscard]] static constexpr Limits room() noexcept { return {}; }
    // A small board: at most 8 MiB.
    [[nodiscard]] static constexpr Limits pocket() noexcept { return {640, 480, 8, 500, 32, 4000, 64, 2500}; }
    // For tests: every full pool happens within seconds; at most 512 KiB.
    [[nodiscard]] static constexpr Limits tiny() noexcept { return {160, 120, 3, 100, 8, 300, 16, 200}; }
};

}  // namespace stillmesh
