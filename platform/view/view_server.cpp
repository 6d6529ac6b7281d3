#include "platform/view/view_server.hpp"

#include <fcntl.h>
#include <fmt/format.h>
#include <httplib.h>
#include <pthread.h>
#include <signal.h>
#include <sys/stat.h>
#include <unistd.h>

#include <algorithm>
#include <array>
#include <atomic>
#include <cerrno>
#include <chrono>
#include <cstring>
#include <iterator>
#include <memory>
#include <mutex>
#include <optional>
#include <string_view>
#include <thread>
#include <utility>
#include <vector>

#include "platform/linux/process.hpp"
#include "platform/view/bounded_tasks.hpp"
#include "platform/view/view_files.hpp"
#include "platform/view/view_message.hpp"
#include "platform/view/view_place.hpp"

namespace stillmesh {
namespace {

constexpr std::int64_t kAliveEvery_ns = 1'000'000'000;
constexpr auto kLookEvery = std::chrono::milliseconds(20);
constexpr int kFarewellMax_ms = 300;
constexpr time_t kPatience_s = 2;  // for a client that takes or says nothing

// Inline scripts and styles are none of ours, nor is anything from elsewhere.
constexpr const char* kContentPolicy =
    "default-src 'none'; script-src 'self'; style-src 'self'; img-src 'self' data:; connect-src 'self'; "
    "base-uri 'none'; form-action 'none'; frame-ancestors 'none'";

class Threads final : public httplib::TaskQueue {
public:
    void enqueue(std::function<void()> task) override { tasks_.add(std::move(task)); }
    void shutdown() override { tasks_.finish(); }

private:
    BoundedTasks tasks_{kViewThreadsMax};
};

// Signals are for the engine's thread: here they would end accept().
class SignalsBlocked {
public:
    SignalsBlocked() {
        sigset_t all;
        ::sigfillset(&all);
        ::pthread_sigmask(SIG_SETMASK, &all, &before_);
    }
    ~SignalsBlocked() { ::pthread_sigmask(SIG_SETMASK, &before_, nullptr); }
    SignalsBlocked(const SignalsBlocked&) = delete;
    SignalsBlocked& operator=(const SignalsBlocked&) = delete;

private:
    sigset_t before_{};
};

// So many requests in a second, from all clients together.
class RequestRate {
public:
    explicit RequestRate(int per_second) : per_second_(per_second) {}
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
class NewestFrame {
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
class Stream {
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

class HttpViewServer final : public ViewServer {
public:
    HttpViewServer(ViewFeed& feed, std::string token) : feed_(feed), newest_(feed), token_(std::move(token)) {}
    ~HttpViewServer() override {
        is_over_.store(true);
        if (!thread_.joinable()) return;
        // Streams that are read end by themselves, and say so; stop() cuts the others off.
        for (int i = 0; streams_.load() > 0 && i < kFarewellMax_ms; ++i) {
            std::this_thread::sleep_for(std::chrono::milliseconds(1));
        }
        server_.stop();
        thread_.join();
    }
    HttpViewServer(const HttpViewServer&) = delete;
    HttpViewServer& operator=(const HttpViewServer&) = delete;

    [[nodiscard]] bool open(const ViewAddress& address, std::string& message) {
        address_ = address;
        limit();
        route();
        errno = 0;
        if (address.port == 0) {
            address_.port = server_.bind_to_any_port(address.host);
        } else if (!server_.bind_to_port(address.host, address.port)) {
            address_.port = -1;
        }
        if (address_.port <= 0) {
            message =
                fmt::format("--view {}:{}: cannot be served at: {}; give another port, or an address of this machine.",
                            address.host, address.port, errno != 0 ? std::strerror(errno) : "no such address");
            return false;
        }
        {
            const SignalsBlocked blocked;
            thread_ = std::thread([this] { static_cast<void>(server_.listen_after_bind()); });
        }
        while (!server_.is_running()) std::this_thread::sleep_for(std::chrono::milliseconds(1));
        return true;
    }
    [[nodiscard]] std::string sentence() const override {
        const bool is_any = address_.host == "0.0.0.0" || address_.host == "::";
        std::string host = address_.host;
        if (is_any) {
            std::array<char, 256> name{};
            host = ::gethostname(name.data(), name.size() - 1) == 0 ? name.data() : "localhost";
        } else if (host.find(':') != std::string::npos) {
            host = "[" + host + "]";
        }
        return fmt::format("view: http://{}:{}/{} ({}{})", host, address_.port,
                           token_.empty() ? "" : "#token=" + token_,
                           is_loopback(address_.host) ? "from this machine alone"
                                                      : "for everybody on the network: nobody is asked who he is",
                           token_.empty() ? "" : "; who has the token may steer");
    }

private:
    void limit() {
        server_.new_task_queue = [] { return new Threads; };
        // One request a connection: a thread that waits for a second one is a thread less for others.
        server_.set_keep_alive_max_count(1);
        server_.set_keep_alive_timeout(kPatience_s);
        server_.set_read_timeout(kPatience_s);
        server_.set_write_timeout(kPatience_s);
        server_.set_payload_max_length(1024);
        server_.set_tcp_nodelay(true);
        // Its default, SO_REUSEPORT, would give two runs one port.
        server_.set_socket_options([](socket_t socket) {
            const int on = 1;
            static_cast<void>(::setsockopt(socket, SOL_SOCKET, SO_REUSEADDR, &on, sizeof on));
        });
        server_.set_default_headers({{"Content-Security-Policy", kContentPolicy},
                                     {"X-Content-Type-Options", "nosniff"},
                                     {"X-Frame-Options", "DENY"},
                                     {"Referrer-Policy", "no-referrer"},
                                     {"Cross-Origin-Resource-Policy", "same-origin"},
                                     {"Cache-Control", "no-store"}});
    }
    // Before anything of the request's body is read.
    [[nodiscard]] bool refuse(const httplib::Request& request, httplib::Response& response) {
        const bool is_command = request.method == "POST" && request.path == "/command" && !token_.empty();
        const bool is_download = std::any_of(kViewDownloads.begin(), kViewDownloads.end(),
                                             [&](const ViewDownload& one) { return request.path == one.path; });
        if (!rate_.allows(monotonic_ns())) {
            refuse_request(response, 429, "too many requests; wait a second.");
        } else if (!is_own_host(request.get_header_value("Host"), address_.host)) {
            refuse_request(response, 403, "this name is not this machine's; open the page by its address.");
        } else if (request.method != "GET" && request.method != "HEAD" && !is_command) {
            refuse_request(response, 405, "there is nothing to be changed here; GET alone.");
        } else if (!request.ranges.empty()) {
            refuse_request(response, 416, "files are given whole.");
        } else if (is_download && token_.empty()) {
            refuse_request(response, 403, "is for who has a token; start the run with --view-token.");
        } else if ((is_command || is_download) &&
                   !is_same_token(request.get_header_value("X-Stillmesh-Token"), token_)) {
            const bool is_patient = wrong_tokens_.allows(monotonic_ns());
            refuse_request(response, is_patient ? 403 : 429,
                           is_patient ? "that is not the token; it was said when the run began."
                                      : "too many wrong tokens; wait a second.");
        } else {
            return false;
        }
        return true;
    }
    void route_commands() {
        if (token_.empty()) return;
        server_.Post("/command", [this](const httplib::Request& request, httplib::Response& response) {
            const std::optional<ViewCommand> command = parse_view_command(request.body);
            if (!command) return refuse_request(response, 400, "is no command; see docs/view.md.");
            if (!feed_.commands().put(*command)) {
                return refuse_request(response, 503, "the run has not yet done what it was told before; wait.");
            }
            response.status = 202;
            response.set_content("will be done behind this frame.\n", "text/plain; charset=utf-8");
        });
    }
    void route_files() {
        for (std::size_t i = 0; i < kViewDownloads.size(); ++i) {
            server_.Get(kViewDownloads[i].path, [this, i](const httplib::Request&, httplib::Response& response) {
                const std::string name = feed_.downloads().file(i);
                const auto file = std::make_shared<OpenFile>(name);
                if (!file->is_open()) {
                    return refuse_request(response, 404,
                                          (name.empty() ? std::string("this run writes none; start it with ") +
                                                              kViewDownloads[i].option + "."
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
    void route_downloads() {
        for (const bool is_csv : {false, true}) {
            server_.Get(is_csv ? "/poses.csv" : "/trajectory.txt", [this, is_csv](const httplib::Request&,
                                                                                  httplib::Response& response) {
                std::vector<ViewPose> poses;
                feed_.poses(poses);
                std::string text;
                compose_view_poses(poses, is_csv, text);
                response.set_header("Content-Disposition",
                                    is_csv ? "attachment; filename=poses.csv" : "attachment; filename=trajectory.txt");
                response.set_content(text, is_csv ? "text/csv; charset=utf-8" : "text/plain; charset=utf-8");
            });
        }
    }
    void route() {
        using Answer = httplib::Server::HandlerResponse;
        server_.set_pre_routing_handler([this](const httplib::Request& request, httplib::Response& response) {
            return refuse(request, response) ? Answer::Handled : Answer::Unhandled;
        });
        route_commands();
        route_downloads();
        route_files();
        for (const ViewFile& file : view_files()) {
            server_.Get(std::string(file.path), [&file](const httplib::Request&, httplib::Response& response) {
                // From a provider: what is given as a text would be compressed anew for each who asks.
                response.set_content_provider(file.bytes.size(), file.type,
                                              [&file](std::size_t offset, std::size_t size, httplib::DataSink& sink) {
                                                  return sink.write(file.bytes.data() + offset, size);
                                              });
            });
        }
        server_.Get("/stream", [this](const httplib::Request& request, httplib::Response& response) {
            if (request.method == "HEAD") return;
            if (streams_.fetch_add(1) >= kViewStreamsMax) {
                streams_.fetch_sub(1);
                return refuse_request(response, 503, "as many look on as can be served; try later.");
            }
            auto stream = std::make_shared<Stream>(feed_, newest_, !token_.empty(), is_over_, streams_);
            response.set_chunked_content_provider(
                "text/event-stream", [stream](std::size_t, httplib::DataSink& sink) { return stream->go_on(sink); });
        });
    }

    ViewFeed& feed_;
    NewestFrame newest_;
    const std::string token_;
    std::atomic<bool> is_over_{false};
    std::atomic<int> streams_{0};
    RequestRate rate_{kViewRequestsPerSecond}, wrong_tokens_{kViewWrongTokensPerSecond};
    ViewAddress address_;
    httplib::Server server_;
    std::thread thread_;
};

}  // namespace

std::unique_ptr<ViewServer> open_view_server(const ViewServerOptions& options, ViewFeed& feed, std::string& message) {
    ViewAddress address;
    if (!parse_view_address(options.place, address, message)) return nullptr;
    auto server = std::make_unique<HttpViewServer>(feed, options.token);
    if (!server->open(address, message)) return nullptr;
    return server;
}

}  // namespace stillmesh
