// What depth images show, in three dimensions: an OctoMap of cubes of 5 cm that were seen empty or occupied (binary
// .bt, as octomap_server and MoveIt read it), level where the floor is known. Images are taken oldest first, and what
// was moved has left its place after four looks through it; rays to what moves, or to where nothing was measured, are
// left out. Not for a run: memory follows the room, some 20 bytes a cube. In a build without liboctomap it says so.
#pragma once

#include <string>

#include "platform/grid/grid_job.hpp"

namespace stillmesh {

// Of a job that is done. False: `message`.
[[nodiscard]] bool write_octomap(const DepthSource& images, const GridJob& job, const std::string& file,
                                 std::string& message);

}  // namespace stillmesh
