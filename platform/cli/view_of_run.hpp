// `--view [ADDRESS:]PORT` and `--view-token TOKEN`: the page of a run, served before there is a camera, or when the run
// begins.
#pragma once

#include <memory>
#include <string>

#include "platform/view/view_feed.hpp"
#include "platform/view/view_server.hpp"

namespace CLI {
class App;
}

namespace stillmesh {

void add_view_options(CLI::App& run, ViewServerOptions& options);
// The command as it was typed, for the report: without the token.
[[nodiscard]] std::string command_without_token(int argc, const char* const* argv);

class ViewOfRun {
public:
    // Nothing where no place is given, or it is served already; else what to tell the user is on standard error. The
    // token "auto" is made here. False: `message` says why.
    [[nodiscard]] bool open(const ViewServerOptions& options, std::string& message);
    // Also without a server: a report is made of it.
    [[nodiscard]] ViewFeed& feed();
    [[nodiscard]] ViewFeed* feed_if_any() { return feed_.get(); }

private:
    std::unique_ptr<ViewFeed> feed_;
    std::unique_ptr<ViewServer> server_;  // goes before the feed
};

}  // namespace stillmesh
