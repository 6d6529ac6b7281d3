#include "platform/cli/grid_options.hpp"

#include <fmt/format.h>

#include <CLI/CLI.hpp>
#include <vector>

namespace stillmesh {

void add_grid_options(CLI::App& app, GridOutputOptions& options, const std::string& when, const char* group,
                      bool has_gravity) {
    const std::vector<std::string> levels =
        has_gravity ? std::vector<std::string>{"off", "floor", "gravity"} : std::vector<std::string>{"off", "floor"};
    CLI::Option* const all[] = {
        app.add_option(
               "--grid", options.grid,
               "where a robot can drive, for Nav2: NAME.yaml and NAME.pgm, without people" + when + " (docs/grid.md)")
            ->type_name("NAME"),
        app.add_option("--cloud", options.cloud, "what the keyframes saw: a PLY file of points")->type_name("FILE"),
        app.add_option_function<std::string>(
               "--level",
               [&options](const std::string& by) {
                   options.level = by == "floor" ? Level::kFloor : by == "gravity" ? Level::kGravity : Level::kOff;
               },
               std::string("of the cloud: off (default: as the map lies), floor: z up, the floor at 0") +
                   (has_gravity ? ", or gravity: z up by an accelerometer" : "") +
                   "; a grid always is level, by the floor")
            ->check(CLI::IsMember(levels).description(""))
            ->type_name("NAME"),
        app.add_option("--obstacle-height", options.obstacle_m,
                       "of a grid: what is higher above the floor is in the way; 0.08")
            ->check(CLI::Range(0.02, 1.0).description(""))
            ->type_name("M"),
        app.add_option("--robot-height", options.robot_m, "of a grid: what begins higher above the floor is not; 1.2")
            ->check(CLI::Range(0.1, 3.0).description(""))
            ->type_name("M")};
    if (*group == '\0') return;
    for (CLI::Option* const option : all) option->group(group);
}

bool grid_options_of(const GridOutputOptions& options, GridOptions& grid, std::string& message) {
    if (options.robot_m <= options.obstacle_m) {
        message = fmt::format("--robot-height {:g}: is not above --obstacle-height {:g}; give a larger one.",
                              options.robot_m, options.obstacle_m);
        return false;
    }
    grid.obstacle_m = options.obstacle_m;
    grid.robot_m = options.robot_m;
    return true;
}

}  // namespace stillmesh
