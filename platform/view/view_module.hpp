// The server of the page as a module (platform/linux/module.hpp): a run that nobody looks at has neither cpp-httplib in
// its memory nor OpenSSL, which that needs.
#pragma once

#include <memory>
#include <string>

#include "platform/view/view_server.hpp"

namespace stillmesh {

struct ViewModule {
    decltype(&open_view_server) open;
};

// open_view_server of the module. null: `message` says why, or that the module is not there and what to do.
[[nodiscard]] std::unique_ptr<ViewServer> load_view_server(const ViewServerOptions& options, ViewFeed& feed,
                                                           std::string& message);

}  // namespace stillmesh
