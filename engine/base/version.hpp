// The version of these headers, for #if; the build reads it from here.
#pragma once

#define STILLMESH_VERSION_MAJOR 0
#define STILLMESH_VERSION_MINOR 1
#define STILLMESH_VERSION_PATCH 0
// To compare: #if STILLMESH_VERSION >= STILLMESH_VERSION_OF(0, 2, 0)
#define STILLMESH_VERSION_OF(major, minor, patch) ((major)*1000000 + (minor)*1000 + (patch))
#define STILLMESH_VERSION \
    STILLMESH_VERSION_OF(STILLMESH_VERSION_MAJOR, STILLMESH_VERSION_MINOR, STILLMESH_VERSION_PATCH)
