// Grid, cloud and OctoMap of a map file, for `map export`: what `run --grid --cloud` would have written when the map
// was saved, and cubes of the same looks. Memory: the grid's (docs/grid.md), and 12 bytes a point of the cloud.
#pragma once

#include <string>
#include <vector>

#include "platform/cli/destinations.hpp"
#include "platform/cli/grid_options.hpp"
#include "platform/record/map_content.hpp"

namespace stillmesh {

// What is going to be written.
void add_grid_destinations(const GridOutputOptions& options, const std::string& octomap,
                           std::vector<Destination>& destinations);
// `octomap`: a file, empty: none. The program's exit code: 0; 1 something could not be made or written; 2 the file
// `name` has nothing to make it of.
[[nodiscard]] int write_grid_of(const SavedMap& map, const std::string& name, const GridOutputOptions& options,
                                const std::string& octomap);

}  // namespace stillmesh
