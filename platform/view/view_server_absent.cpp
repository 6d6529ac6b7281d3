// A build without cpp-httplib or three.js.
#include "platform/view/view_server.hpp"

namespace stillmesh {

std::unique_ptr<ViewServer> open_view_server(const ViewServerOptions& options, ViewFeed& feed, std::string& message) {
    static_cast<void>(feed);
    message = "--view " + options.place +
              ": not in this build; install libcpp-httplib-dev and libjs-three, and configure it with "
              "-DSTILLMESH_WITH_VIEW=ON.";
    return nullptr;
}

}  // namespace stillmesh
