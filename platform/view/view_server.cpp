#include "platform/view/view_server.hpp"

#include <fmt/format.h>
#include <httplib.h>
#include <pthread.h>
#include <signal.h>

#include <array>
#include <cerrno>
#include <chrono>
#include <cstring>
#include <memory>
#include <string>
#include <thread>
#include <utility>

#include "platform/view/bounded_tasks.hpp"
#include "platform/view/view_place.hpp"
#include "platform/view/view_requests.hpp"

namespace stillmesh {
namespace {

constexpr int kFarewellMax_ms = 300;
constexpr time_t kPatience_s = 2;  // for a client that takes or says nothing

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

class HttpViewServer final : public ViewServer {
public:
    HttpViewServer(ViewFeed& feed, std::string token, ViewAddress address)
        : token_(std::move(token)), address_(std::move(address)), requests_(feed, token_, address_.host) {}
    ~HttpViewServer() override {
        requests_.end();
        if (!thread_.joinable()) return;
        // Streams that are read end by themselves, and say so; stop() cuts the others off.
        for (int i = 0; requests_.streams() > 0 && i < kFarewellMax_ms; ++i) {
            std::this_thread::sleep_for(std::chrono::milliseconds(1));
        }
        server_.stop();
        thread_.join();
    }
    HttpViewServer(const HttpViewServer&) = delete;
    HttpViewServer& operator=(const HttpViewServer&) = delete;

    [[nodiscard]] bool open(std::string& message) {
        limit();
        requests_.answer_in(server_);
        errno = 0;
        int port = address_.port;
        if (port == 0) {
            port = server_.bind_to_any_port(address_.host);
        } else if (!server_.bind_to_port(address_.host, port)) {
            port = -1;
        }
        if (port <= 0) {
            message =
                fmt::format("--view {}:{}: cannot be served at: {}; give another port, or an address of this machine.",
                            address_.host, address_.port, errno != 0 ? std::strerror(errno) : "no such address");
            return false;
        }
        address_.port = port;
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
        server_.set_tcp_nodelay(true);
        // Its default, SO_REUSEPORT, would give two runs one port.
        server_.set_socket_options([](socket_t socket) {
            const int on = 1;
            static_cast<void>(::setsockopt(socket, SOL_SOCKET, SO_REUSEADDR, &on, sizeof on));
        });
    }

    const std::string token_;
    ViewAddress address_;
    ViewRequests requests_;
    httplib::Server server_;
    std::thread thread_;
};

}  // namespace

std::unique_ptr<ViewServer> open_view_server(const ViewServerOptions& options, ViewFeed& feed, std::string& message) {
    ViewAddress address;
    if (!parse_view_address(options.place, address, message)) return nullptr;
    auto server = std::make_unique<HttpViewServer>(feed, options.token, std::move(address));
    if (!server->open(message)) return nullptr;
    return server;
}

}  // namespace stillmesh
