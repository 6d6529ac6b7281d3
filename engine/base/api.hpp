// Marks what the engine library exports. Everything else in it, Eigen included, is hidden and becomes local to the one
// object the library consists of (engine/CMakeLists.txt).
#pragma once

#define STILLMESH_API __attribute__((visibility("default")))
