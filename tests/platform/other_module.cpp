// A module of another version.
#include "platform/linux/module.hpp"

const stillmesh::Module* stillmesh_module() {
    static constexpr stillmesh::Module kModule = {.version = "0.0.0", .calls = &kModule};
    return &kModule;
}
