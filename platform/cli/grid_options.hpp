// The options of `run` and `map export` for a grid to drive in and a cloud (docs/grid.md), and what of them cannot be.
#pragma once

#include <string>

#include "platform/grid/occupancy_grid.hpp"

namespace CLI {
class App;
}

namespace stillmesh {

struct GridOutputOptions {
    std::string grid;       // NAME of NAME.yaml and NAME.pgm; empty: none
    std::string cloud;      // file; empty: none
    bool is_level = false;  // the cloud: z up, floor at 0
    double obstacle_m = GridOptions{}.obstacle_m;
    double robot_m = GridOptions{}.robot_m;
    [[nodiscard]] bool is_any() const { return !grid.empty() || !cloud.empty(); }
};

// `when`: they are written, for the help; `group`: of the help, may be empty.
void add_grid_options(CLI::App& app, GridOutputOptions& options, const std::string& when, const char* group);
// What the grid is to be made with. False: `message` says what cannot be.
[[nodiscard]] bool grid_options_of(const GridOutputOptions& options, GridOptions& grid, std::string& message);

}  // namespace stillmesh
