// `stillmesh map info | export` (merge: map_merge_command.hpp): what a map file holds, for people and for other
// programs.
#pragma once

#include <string>

#include "platform/cli/grid_options.hpp"

namespace stillmesh {

struct MapExport {
    std::string file;         // the map
    std::string ply, pcd;     // points; empty: not written
    std::string tum;          // keyframes' poses
    std::string json;         // camera, keyframes, points; "-" is standard output
    bool has_moving = false;  // points that have lost their weight as well
    GridOutputOptions grid;   // and cloud
    std::string octomap;      // cubes
};

// Both return the program's exit code: 0; 1 could not make or write it; 2 no map, or bad usage.
[[nodiscard]] int map_info_command(const std::string& file, bool is_json);
[[nodiscard]] int map_export_command(const MapExport& options);

}  // namespace stillmesh
