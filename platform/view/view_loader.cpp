#include "platform/linux/module.hpp"
#include "platform/view/view_module.hpp"

namespace stillmesh {

std::unique_ptr<ViewServer> load_view_server(const ViewServerOptions& options, ViewFeed& feed, std::string& message) {
    const auto* const module = static_cast<const ViewModule*>(open_module(
        {.name = "view",
         .absent = "not in this build",
         .remedy = "; install libcpp-httplib-dev and libjs-three, and configure it with -DSTILLMESH_WITH_VIEW=ON."},
        message));
    if (module != nullptr) return module->open(options, feed, message);
    message.insert(0, "--view " + options.place + ": ");
    return nullptr;
}

}  // namespace stillmesh
