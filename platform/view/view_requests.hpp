// What the page answers to a request, whatever brings it: the files of view_files.hpp, the stream, downloads and
// commands, and what is refused (view_server.hpp). Knows no socket and no thread; the fuzz target `requests` asks it
// without either.
#pragma once

#include <httplib.h>

#include <atomic>
#include <memory>
#include <string>

#include "platform/view/view_feed.hpp"
#include "platform/view/view_server.hpp"

namespace stillmesh {

struct ViewRequestLimits {  // from all clients together
    int per_second = kViewRequestsPerSecond;
    int wrong_tokens_per_second = kViewWrongTokensPerSecond;
};

class ViewRequests {
public:
    // `feed` outlives it. `token`: of who may steer, empty: nobody; `host`: the address that it is served at.
    ViewRequests(ViewFeed& feed, std::string token, std::string host, const ViewRequestLimits& limits = {});
    ~ViewRequests();
    ViewRequests(const ViewRequests&) = delete;
    ViewRequests& operator=(const ViewRequests&) = delete;

    // From here on `server`, which does not outlive it, answers with it.
    void answer_in(httplib::Server& server);
    // Streams say that the run is over, and end; how many have not yet.
    void end() noexcept { is_over_.store(true); }
    [[nodiscard]] int streams() const noexcept { return streams_.load(); }

private:
    class Rate;
    class NewestFrame;
    class Stream;

    [[nodiscard]] bool refuse(const httplib::Request& request, httplib::Response& response);
    void route_commands(httplib::Server& server);
    void route_files(httplib::Server& server);
    void route_downloads(httplib::Server& server);
    void route_stream(httplib::Server& server);

    ViewFeed& feed_;
    const std::string token_, host_;
    std::unique_ptr<NewestFrame> newest_;
    std::unique_ptr<Rate> rate_, wrong_tokens_;
    std::atomic<bool> is_over_{false};
    std::atomic<int> streams_{0};
};

}  // namespace stillmesh
