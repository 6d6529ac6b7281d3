// Serves the page that shows a run, over HTTP, on threads of its own: the files of view_files.hpp; /stream, the run as
// server-sent events (frame, news, control, alive, end); /trajectory.txt and /poses.csv, the path as it is shown. Read
// only, unless it was opened with a token: then POST /command (view_commands.hpp) and the files that the run writes
// (view_downloads.hpp), with the token in the header X-Stillmesh-Token, which no other site can send. No path reaches a
// file.
//
// Limits: kViewStreamsMax streams, kViewThreadsMax connections served at a time and as many waiting, 50 requests a
// second (more: 429), GET and HEAD alone but for commands of 64 bytes, no ranges. Who takes nothing for two seconds is
// dropped; nobody is waited for, but at the end of the run, two seconds at most. Other sites are kept out by name: a
// request's Host must be this machine (view_place.hpp), which a page that had its own name resolved to our address (DNS
// rebinding) cannot say.
#pragma once

#include <cstddef>
#include <memory>
#include <string>

#include "platform/view/view_feed.hpp"

namespace stillmesh {

inline constexpr int kViewStreamsMax = 8;
inline constexpr std::size_t kViewThreadsMax = kViewStreamsMax + 6;
inline constexpr int kViewRequestsPerSecond = 50;
inline constexpr int kViewWrongTokensPerSecond = 5;
inline constexpr std::size_t kViewTokenMin = 12, kViewTokenMax = 64;  // letters, digits, - and _

class ViewServer {
public:
    virtual ~ViewServer() = default;  // ends all streams and threads
    // What to tell the user: where to look, and who can.
    [[nodiscard]] virtual std::string sentence() const = 0;
};

struct ViewServerOptions {
    std::string place;  // [ADDRESS:]PORT; without an address for this machine alone; port 0: any that is free
    std::string token;  // who says it may steer; empty: nobody may
};
// Of the module, which the program calls by load_view_server (view_module.hpp). null: `message` says why. Called by the
// thread whose priority its threads shall have.
[[nodiscard]] std::unique_ptr<ViewServer> open_view_server(const ViewServerOptions& options, ViewFeed& feed,
                                                           std::string& message);

}  // namespace stillmesh
