// Options for what people know beside the camera: how it moved, where it starts, where not to look. Each is for `run`;
// what a recording cannot know of them is asked of `rerun` again.
#pragma once

#include <CLI/CLI.hpp>
#include <optional>

#include "engine/geometry/rigid_transform.hpp"
#include "platform/cli/run_command.hpp"

namespace stillmesh {

void add_prior_options(CLI::App& app, RunArguments& arguments, const char* group);
// --start-pose, of run and rerun.
void add_start_option(CLI::App& app, std::optional<RigidTransform>& start, const char* sentence, const char* group);

}  // namespace stillmesh
