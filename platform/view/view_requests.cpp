#include "platform/view/view_requests.hpp"

#include <fcntl.h>
#include <fmt/format.h>
#include <sys/stat.h>
#include <unistd.h>

#include <algorithm>
#include <array>
#include <chrono>
#include <iterator>
#include <mutex>
#include <optional>
#include <string_view>
#include <thread>
#include <utility>
#include <vector>

#include "platform/linux/process.hpp"
#include "platform/view/view_files.hpp"
#include "platform/view/view_message.hpp"
#include "platform/view/view_place.hpp"

namespace stillmesh {
namespace {

constexpr std::int64_t kAliveEvery_ns = 1'000'000'000;
constexpr auto kLookEvery = std::chrono::milliseconds(20);

// Inline scripts and styles are none of ours, nor is anything from elsewhere.
constexpr const char* kContentPolicy =
    "default-src 'none'; script-src 'self'; style-src 'self'; img-src 'self' data:; connect-src 'self'; "
    "base-uri 'none'; form-action 'none'; frame-ancestors 'none'";

// A file as it was when it was asked for: what is written in its place later is another one.
class OpenFile {
public:
    explicit OpenFile(const std::string& name) {
        // Of a FIFO nobody waits for the other end.
        const int file = name.empty() ? -1 : ::open(name.c_str(), O_RDONLY | O_CLOEXEC | O_NONBLOCK);
        struct stat status {};
        if (file >= 0 && (::fstat(file, &status) != 0 || !S_ISREG(status.st_mode))) {
            static_cast<void>(::close(file));
            return;
        }
        file_ = file;
        size_ = static_cast<std::size_t>(status.st_size);
    }
    ~OpenFile() {
        if (is_open()) static_cast<void>(::close(file_));
    }
    OpenFile(const OpenFile&) = delete;
    OpenFile& operator=(const OpenFile&) = delete;
    [[nodiscard]] bool is_open() const { return file_ >= 0; }
    [[nodiscard]] std::size_t size() const { return size_; }
    // A piece of it. False: it cannot be read, or nobody takes it.
    [[nodiscard]] bool give(std::size_t offset, std::size_t size, httplib::DataSink& sink) const {
        std::array<char, 65536> piece{};
        const ssize_t got = ::pread(file_, piece.data(), std::min(size, piece.size()), static_cast<off_t>(offset));
        return got > 0 && sink.write(piece.data(), static_cast<std::size_t>(got));
    }

private:
    int file_ = -1;
    std::size_t size_ = 0;
};

// cpp-httplib takes a route for a regular expression, in which a dot is any letter: /roomXmap would be the map, which
// refuse() knows as /room.map alone, and needs no token.
[[nodiscard]] std::string only(std::string_view path) {
    std::string out;
    for (const char c : path) out += c == '.' ? std::string("\\.") : std::string(1, c);
    return out;
}

void refuse_request(httplib::Response& response, int status, const char* sentence) {
    response.status = status;
    response.set_content(std::string(sentence) + "\n", "text/plain; charset=utf-8");
}

// As long whatever the first difference is: how long an answer takes says nothing of the token.
[[nodiscard]] bool is_same_token(std::string_view given, std::string_view token) {
    unsigned difference = given.size() == token.size() ? 0 : 1;
    for (std::size_t i = 0; i < token.size(); ++i) {
        const char c = i < given.size() ? given[i] : '\0';
        difference |= static_cast<unsigned>(static_cast<unsigned char>(c) ^ static_cast<unsigned char>(token[i]));
    }
    return difference == 0;
}

}  // namespace

// So many requests in a second, from all clients together.
class ViewRequests::Rate {
public:
    explicit Rate(int per_second) : per_second_(per_second) {}
    [[nodiscard]] bool allows(std::int64_t now_ns) {
        const std::lock_guard lock(mutex_);
        if (now_ns - begin_ns_ >= 1'000'000'000) {
            begin_ns_ = now_ns;
            count_ = 0;
        }
        return ++count_ <= per_second_;
    }

private:
    const int per_second_;
    std::mutex mutex_;
    std::int64_t begin_ns_ = 0;
    int count_ = 0;
};

// The newest frame as a message, composed once for all who look.
class ViewRequests::NewestFrame {
public:
    explicit NewestFrame(ViewFeed& feed) : feed_(feed) { snapshot_.reserve(); }
    // null: there is none behind number `seen`, which goes on.
    [[nodiscard]] std::shared_ptr<const std::string> behind(std::uint64_t& seen) {
        const std::lock_guard lock(mutex_);
        if (feed_.take(snapshot_)) {
            auto message = std::make_shared<std::string>();
            compose_view_frame(snapshot_, *message);
            newest_ = std::move(message);
            ++number_;
        }
        if (number_ == seen) return nullptr;
        seen = number_;
        return newest_;
    }

private:
    ViewFeed& feed_;
    std::mutex mutex_;
    ViewSnapshot snapshot_;
    std::shared_ptr<const std::string> newest_;
    std::uint64_t number_ = 0;
};

// One client's stream. Destroyed when it has left.
class ViewRequests::Stream {
public:
    Stream(ViewFeed& feed, NewestFrame& newest, bool may_steer, const std::atomic<bool>& is_over,
           std::atomic<int>& streams)
        : feed_(feed), newest_(newest), may_steer_(may_steer), is_over_(is_over), streams_(streams) {
        feed_.come();
    }
    ~Stream() {
        feed_.leave();
        streams_.fetch_sub(1);
    }
    Stream(const Stream&) = delete;
    Stream& operator=(const Stream&) = delete;

    // What is new now, after a short wait. False: the stream is over.
    [[nodiscard]] bool go_on(httplib::DataSink& sink) {
        if (is_over_.load()) {
            static_cast<void>(send(sink, "end", "{}"));
            sink.done();
            return true;
        }
        if (!has_begun_) {
            has_begun_ = true;
            constexpr std::string_view kBegin = "retry: 1000\n\n";
            if (!sink.write(kBegin.data(), kBegin.size())) return false;
        }
        if (const std::uint64_t changes = feed_.commands().changes(); changes != control_seen_) {
            control_seen_ = changes;
            compose_view_control(feed_.commands(), feed_.downloads(), may_steer_, text_);
            if (!send(sink, "control", text_)) return false;
        }
        // Clouds that there were before come in parts, without a wait between them.
        feed_.look(cursor_, news_);
        compose_view_news(news_, text_);
        if (!text_.empty() && !send(sink, "news", text_)) return false;
        const std::shared_ptr<const std::string> frame = newest_.behind(seen_);
        if (frame != nullptr && !send(sink, "frame", *frame)) return false;
        const std::int64_t now_ns = monotonic_ns();
        if (now_ns - alive_ns_ >= kAliveEvery_ns) {
            alive_ns_ = now_ns;
            const std::int64_t last_ns = feed_.last_frame_ns();
            const double silent_s = last_ns == 0 ? -1.0 : static_cast<double>(now_ns - last_ns) * 1e-9;
            if (!send(sink, "alive", fmt::format("{{\"silent_s\":{:.1f}}}", silent_s))) return false;
        }
        if (news_.clouds.size() < kViewCloudsAtOnce && frame == nullptr) std::this_thread::sleep_for(kLookEvery);
        return true;
    }

private:
    [[nodiscard]] bool send(httplib::DataSink& sink, const char* event, std::string_view data) {
        out_.clear();
        fmt::format_to(std::back_inserter(out_), "event: {}\ndata: {}\n\n", event, data);
        return sink.write(out_.data(), out_.size());
    }

    ViewFeed& feed_;
    NewestFrame& newest_;
    const bool may_steer_;
    const std::atomic<bool>& is_over_;
    std::atomic<int>& streams_;
    std::uint64_t control_seen_ = 0;
    bool has_begun_ = false;
    std::int64_t alive_ns_ = 0;
    std::uint64_t seen_ = 0;
    ViewCursor cursor_;
    ViewNews news_;
    std::string text_, out_;
};

ViewRequests::ViewRequests(ViewFeed& feed, std::string token, std::string host, const ViewRequestLimits& limits)
    : feed_(feed),
      token_(std::move(token)),
      host_(std::move(host)),
      newest_(std::make_unique<NewestFrame>(feed)),
      rate_(std::make_unique<Rate>(limits.per_second)),
      wrong_tokens_(std::make_unique<Rate>(limits.wrong_tokens_per_second)) {}
ViewRequests::~ViewRequests() = default;

void ViewRequests::answer_in(httplib::Server& server) {
    using Answer = httplib::Server::HandlerResponse;
    server.set_payload_max_length(1024);
    server.set_default_headers({{"Content-Security-Policy", kContentPolicy},
                                {"X-Content-Type-Options", "nosniff"},
                                {"X-Frame-Options", "DENY"},
                                {"Referrer-Policy", "no-referrer"},
                                {"Cross-Origin-Resource-Policy", "same-origin"},
                                {"Cache-Control", "no-store"}});
    server.set_pre_routing_handler([this](const httplib::Request& request, httplib::Response& response) {
        return refuse(request, response) ? Answer::Handled : Answer::Unhandled;
    });
    route_commands(server);
    route_downloads(server);
    route_files(server);
    route_stream(server);
}

// Before anything of the request's body is read.
bool ViewRequests::refuse(const httplib::Request& request, httplib::Response& response) {
    const bool is_command = request.method == "POST" && request.path == "/command" && !token_.empty();
    const bool is_download = std::any_of(kViewDownloads.begin(), kViewDownloads.end(),
                                         [&](const ViewDownload& one) { return request.path == one.path; });
    if (!rate_->allows(monotonic_ns())) {
        refuse_request(response, 429, "too many requests; wait a second.");
    } else if (!is_own_host(request.get_header_value("Host"), host_)) {
        refuse_request(response, 403, "this name is not this machine's; open the page by its address.");
    } else if (request.method != "GET" && request.method != "HEAD" && !is_command) {
        refuse_request(response, 405, "there is nothing to be changed here; GET alone.");
    } else if (!request.ranges.empty()) {
        refuse_request(response, 416, "files are given whole.");
    } else if (is_download && token_.empty()) {
        refuse_request(response, 403, "is for who has a token; start the run with --view-token.");
    } else if ((is_command || is_download) && !is_same_token(request.get_header_value("X-Stillmesh-Token"), token_)) {
        const bool is_patient = wrong_tokens_->allows(monotonic_ns());
        refuse_request(response, is_patient ? 403 : 429,
                       is_patient ? "that is not the token; it was said when the run began."
                                  : "too many wrong tokens; wait a second.");
    } else {
        return false;
    }
    return true;
}

void ViewRequests::route_commands(httplib::Server& server) {
    if (token_.empty()) return;
    server.Post(only("/command"), [this](const httplib::Request& request, httplib::Response& response) {
        const std::optional<ViewCommand> command = parse_view_command(request.body);
        if (!command) return refuse_request(response, 400, "is no command; see docs/view.md.");
        if (!feed_.commands().put(*command)) {
            return refuse_request(response, 503, "the run has not yet done what it was told before; wait.");
        }
        response.status = 202;
        response.set_content("will be done behind this frame.\n", "text/plain; charset=utf-8");
    });
}

void ViewRequests::route_files(httplib::Server& server) {
    for (const ViewFile& file : view_files()) {
        server.Get(only(file.path), [&file](const httplib::Request&, httplib::Response& response) {
            // From a provider: what is given as a text would be compressed anew for each who asks.
            response.set_content_provider(file.bytes.size(), file.type,
                                          [&file](std::size_t offset, std::size_t size, httplib::DataSink& sink) {
                                              return sink.write(file.bytes.data() + offset, size);
                                          });
        });
    }
    for (std::size_t i = 0; i < kViewDownloads.size(); ++i) {
        server.Get(only(kViewDownloads[i].path), [this, i](const httplib::Request&, httplib::Response& response) {
            const std::string name = feed_.downloads().file(i);
            const auto file = std::make_shared<OpenFile>(name);
            if (!file->is_open()) {
                return refuse_request(
                    response, 404,
                    (name.empty() ? std::string("this run writes none; start it with ") + kViewDownloads[i].option + "."
                                  : "was not written yet; save it first.")
                        .c_str());
            }
            response.set_header("Content-Disposition",
                                std::string("attachment; filename=") + (kViewDownloads[i].path + 1));
            response.set_content_provider(file->size(), kViewDownloads[i].type,
                                          [file](std::size_t offset, std::size_t size, httplib::DataSink& sink) {
                                              return file->give(offset, size, sink);
                                          });
        });
    }
}

void ViewRequests::route_downloads(httplib::Server& server) {
    for (const bool is_csv : {false, true}) {
        server.Get(only(is_csv ? "/poses.csv" : "/trajectory.txt"),
                   [this, is_csv](const httplib::Request&, httplib::Response& response) {
                       std::vector<ViewPose> poses;
                       feed_.poses(poses);
                       std::string text;
                       compose_view_poses(poses, is_csv, text);
                       response.set_header("Content-Disposition", is_csv ? "attachment; filename=poses.csv"
                                                                         : "attachment; filename=trajectory.txt");
                       response.set_content(text, is_csv ? "text/csv; charset=utf-8" : "text/plain; charset=utf-8");
                   });
    }
}

void ViewRequests::route_stream(httplib::Server& server) {
    server.Get(only("/stream"), [this](const httplib::Request& request, httplib::Response& response) {
        if (request.method == "HEAD") return;
        if (streams_.fetch_add(1) >= kViewStreamsMax) {
            streams_.fetch_sub(1);
            return refuse_request(response, 503, "as many look on as can be served; try later.");
        }
        auto stream = std::make_shared<Stream>(feed_, *newest_, !token_.empty(), is_over_, streams_);
        response.set_chunked_content_provider(
            "text/event-stream", [stream](std::size_t, httplib::DataSink& sink) { return stream->go_on(sink); });
    });
}

}  // namespace stillmesh
