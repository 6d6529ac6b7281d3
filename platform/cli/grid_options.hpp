// The options of `run` and `map export` for a grid to drive in and a cloud (docs/grid.md), and what of them cannot be.
#pragma once

#include <cstdint>
#include <optional>
#include <string>

#include "engine/geometry/rigid_transform.hpp"
#include "platform/grid/occupancy_grid.hpp"

namespace CLI {
class App;
}

namespace stillmesh {

// What a cloud is levelled by.
enum class Level : std::uint8_t { kOff, kFloor, kGravity };

struct GridOutputOptions {
    std::string grid;           // NAME of NAME.yaml and NAME.pgm; empty: none
    std::string cloud;          // file; empty: none
    Level level = Level::kOff;  // the cloud: z up, floor at 0 where it is known
    double obstacle_m = GridOptions{}.obstacle_m;
    double robot_m = GridOptions{}.robot_m;
    // Of `map export`, as in `run --publish ros2`: its frame has x and origin of where base_link was at first.
    std::optional<RigidTransform> base_from_camera_link;
    [[nodiscard]] bool is_any() const { return !grid.empty() || !cloud.empty(); }
};

// `when`: they are written, for the help; `group`: of the help, may be empty; `has_gravity`: an accelerometer may be
// there.
void add_grid_options(CLI::App& app, GridOutputOptions& options, const std::string& when, const char* group,
                      bool has_gravity);
// What the grid is to be made with. False: `message` says what cannot be.
[[nodiscard]] bool grid_options_of(const GridOutputOptions& options, GridOptions& grid, std::string& message);

}  // namespace stillmesh
