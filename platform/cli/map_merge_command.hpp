// `stillmesh map merge`: two maps of one place become one, or a sentence why not.
#pragma once

#include <CLI/CLI.hpp>
#include <string>
#include <vector>

namespace stillmesh {

struct MapMergeOptions {
    std::string first, second;             // maps
    std::string out;                       // the one that both become, in the coordinates of the first
    std::string limits = "room";           // that it has to keep to: room, pocket
    std::vector<std::string> assignments;  // "key=value": limits among them
    std::string vocabulary = "default";    // or a file
    std::string calibration;               // of the camera, where a map does not hold its lens; empty: the map's
    bool is_json = false;
};

CLI::App* add_map_merge_command(CLI::App& map_command, MapMergeOptions& options);
// Returns the program's exit code: 0; 1 the maps show no place that is the same for certain, or could not write; 2 no
// maps, maps that do not go together or into the limits, or bad usage.
[[nodiscard]] int map_merge_command(const MapMergeOptions& options);

}  // namespace stillmesh
