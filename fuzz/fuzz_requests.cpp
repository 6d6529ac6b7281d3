// What comes over a connection to the page of a run, byte for byte: cpp-httplib reads it, view_requests.cpp answers.
// Without the run's token no file of the run leaves and no command arrives; to who calls this machine by another name
// nothing is given at all; what is answered has the page's policy, and no stream stays open.
#include <unistd.h>

#include <cstdlib>
#include <cstring>
#include <fstream>
#include <string>
#include <string_view>

#include "fuzz/fuzz.hpp"
#include "platform/view/view_requests.hpp"

namespace {

using namespace stillmesh;

constexpr std::string_view kToken = "token-of-a-run";
constexpr std::string_view kSecret = "what only the token opens";

// A connection: what is asked, and what is answered.
class Wire final : public httplib::Stream {
public:
    explicit Wire(std::string_view asked) : asked_(asked) {}
    [[nodiscard]] bool is_readable() const override { return true; }
    [[nodiscard]] bool is_writable() const override { return true; }
    ssize_t read(char* to, std::size_t size) override {
        const std::size_t count = asked_.copy(to, size);
        asked_.remove_prefix(count);
        return static_cast<ssize_t>(count);
    }
    ssize_t write(const char* from, std::size_t size) override {
        answered_.append(from, size);
        return static_cast<ssize_t>(size);
    }
    void get_remote_ip_and_port(std::string& ip, int& port) const override {
        ip = "127.0.0.1";
        port = 1;
    }
    void get_local_ip_and_port(std::string& ip, int& port) const override { get_remote_ip_and_port(ip, port); }
    [[nodiscard]] socket_t socket() const override { return 0; }
    [[nodiscard]] const std::string& answered() const { return answered_; }

private:
    std::string_view asked_;
    std::string answered_;
};

// cpp-httplib without sockets.
class Server final : public httplib::Server {
public:
    Server() { svr_sock_ = 0; }  // it takes itself for open, and streams write
    void answer(Wire& wire) {
        bool is_closed = false;
        static_cast<void>(process_request(wire, true, is_closed, nullptr));
    }
};

// A run that somebody with the token may steer, and whose map lies in a file.
class Run {
public:
    Run() : requests_(feed_, std::string(kToken), "127.0.0.1", {1 << 30, 1 << 30}) {
        char name[] = "/tmp/stillmesh-fuzz-XXXXXX";
        const int file = ::mkstemp(name);
        fuzz::expect(file >= 0, "there is room for a file");
        fuzz::expect(::write(file, kSecret.data(), kSecret.size()) > 0, "and for what is in it");
        static_cast<void>(::close(file));
        map_ = name;
        feed_.downloads().set({map_, map_, map_, map_});
        requests_.answer_in(server_);
        requests_.end();  // a stream is over as it begins
    }
    ~Run() { static_cast<void>(::unlink(map_.c_str())); }
    Run(const Run&) = delete;
    Run& operator=(const Run&) = delete;

    // Whether a command came, and the answer.
    bool ask(std::string_view asked, std::string& answered) {
        Wire wire(asked);
        server_.answer(wire);
        answered = wire.answered();
        fuzz::expect(requests_.streams() == 0, "no stream stays open");
        bool has_command = false;
        while (feed_.commands().take()) has_command = true;
        return has_command;
    }

private:
    ViewFeed feed_;
    ViewRequests requests_;
    Server server_;
    std::string map_;
};

// What holds for every answer.
void answer_keeps_its_promise(std::string_view answered) {
    if (answered.empty()) return;  // not a request at all
    if (answered.starts_with("HTTP/1.1 100 Continue\r\n\r\n")) answered.remove_prefix(25);
    if (answered.empty()) return;
    fuzz::expect(answered.starts_with("HTTP/1.1 "), "an answer begins like one");
    const std::string_view head = answered.substr(0, answered.find("\r\n\r\n"));
    fuzz::expect(head.find("Content-Security-Policy: default-src 'none'") != std::string_view::npos,
                 "every answer has the page's policy");
    fuzz::expect(head.find("Access-Control-Allow-Origin") == std::string_view::npos, "no other site may read it");
}

[[nodiscard]] bool is_given(std::string_view answered) {
    return answered.starts_with("HTTP/1.1 2");
}

}  // namespace

extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size_bytes) {
    static Run run;
    const std::string_view text(reinterpret_cast<const char*>(data), size_bytes);
    std::string answered;
    const bool has_command = run.ask(text, answered);
    answer_keeps_its_promise(answered);
    // Headers may be written with percent signs.
    if (httplib::detail::decode_url(std::string(text), false).find(kToken) == std::string::npos) {
        fuzz::expect(!has_command, "who does not know the token commands nothing");
        fuzz::expect(answered.find(kSecret) == std::string::npos, "and gets no file of the run");
    }

    // The same from a page that had its own name resolved to this machine.
    const std::size_t line = text.find('\n');
    if (line == std::string_view::npos) return 0;
    const std::string foreign =
        std::string(text.substr(0, line + 1)) + "Host: elsewhere.example\r\n" + std::string(text.substr(line + 1));
    const bool has_foreign_command = run.ask(foreign, answered);
    answer_keeps_its_promise(answered);
    fuzz::expect(!has_foreign_command && !is_given(answered) && answered.find(kSecret) == std::string::npos,
                 "to another name for this machine nothing is given");
    return 0;
}
