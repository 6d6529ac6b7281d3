#include "platform/view/view_module.hpp"

#include "platform/linux/module.hpp"

const stillmesh::Module* stillmesh_module() {
    using namespace stillmesh;
    static constexpr ViewModule kCalls = {.open = open_view_server};
    static constexpr Module kModule = {.version = STILLMESH_PROGRAM_VERSION, .calls = &kCalls};
    return &kModule;
}
