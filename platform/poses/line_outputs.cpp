#include "platform/poses/line_outputs.hpp"

#include <fcntl.h>
#include <netdb.h>
#include <netinet/in.h>
#include <netinet/tcp.h>
#include <poll.h>
#include <sys/socket.h>
#include <sys/stat.h>
#include <sys/un.h>
#include <unistd.h>

#include <algorithm>
#include <array>
#include <cerrno>
#include <cstring>
#include <ctime>
#include <optional>

namespace stillmesh {
namespace {

constexpr int kAcceptedAtOnceMax = 4;  // of a storm of connections: the rest waits for the next line
constexpr int kFarewellMax_ms = 300;   // for readers to take what is on its way when the run ends

class Descriptor {
public:
    Descriptor() = default;
    explicit Descriptor(int value) : value_(value) {}
    ~Descriptor() { reset(); }
    Descriptor(Descriptor&& other) noexcept : value_(other.value_) { other.value_ = -1; }
    Descriptor& operator=(Descriptor&& other) noexcept {
        if (this != &other) {
            reset();
            value_ = other.value_;
            other.value_ = -1;
        }
        return *this;
    }
    [[nodiscard]] int get() const { return value_; }
    [[nodiscard]] bool is_open() const { return value_ >= 0; }
    void reset() {
        if (value_ >= 0) static_cast<void>(::close(value_));
        value_ = -1;
    }

private:
    int value_ = -1;
};

// What somebody has lost.
class Losses {
public:
    Losses(const std::string& name, const LineOutputOptions& options)
        : name_(std::string(options.option) + " " + name), what_(options.what) {}
    // What to say: of the first.
    [[nodiscard]] std::string add(std::uint64_t lines, const char* why) {
        lost_ += lines;
        if (!first_why_.empty()) return {};
        first_why_ = why;
        return name_ + ": " + why + "; the run goes on without these " + what_ + ".";
    }
    [[nodiscard]] std::string problem() const {
        if (lost_ == 0) return {};
        return name_ + ": " + first_why_ + "; " + std::to_string(lost_) + " " + what_ + " were lost.";
    }

private:
    std::string name_, what_, first_why_;
    std::uint64_t lost_ = 0;
};

class FileOutput final : public LineOutput {
public:
    [[nodiscard]] bool open(const std::string& file, const LineOutputOptions& options, std::string& message) {
        if (options.is_added_to) lines_.add_to_it();
        lines_.limit_to(options.bytes_max);
        if (file == "-") lines_.wait_for_reader(options.patience_ms);
        return lines_.open(file, message);
    }
    std::string write(std::string_view lines) override { return lines_.write(lines); }
    std::string problem() const override { return lines_.problem(); }
    bool reopen(std::string& message) override { return lines_.reopen(message); }

private:
    CountedLines lines_;
};

class DatagramOutput final : public LineOutput {
public:
    DatagramOutput(const std::string& name, const LineOutputOptions& options) : losses_(name, options) {}
    void connect(Descriptor socket) { socket_ = std::move(socket); }
    std::string write(std::string_view lines) override {
        if (::send(socket_.get(), lines.data(), lines.size(), MSG_DONTWAIT | MSG_NOSIGNAL) >= 0) return {};
        const int error = errno;
        return losses_.add(1, error == ECONNREFUSED ? "nobody listens there"
                              : error == EAGAIN     ? "the network does not keep up"
                                                    : std::strerror(error));
    }
    std::string problem() const override { return losses_.problem(); }

private:
    Descriptor socket_;
    Losses losses_;
};

class ReadersOutput final : public LineOutput {
public:
    // `path`: of a socket in the file system, to be taken away at the end; empty: none.
    ReadersOutput(const std::string& name, const LineOutputOptions& options, Descriptor listening, std::string path)
        : listening_(std::move(listening)), path_(std::move(path)), losses_(name, options) {
        for (Reader& reader : readers_) reader.pending.reserve(kPendingBytesMax);
    }
    ~ReadersOutput() override {
        say_farewell();
        if (!path_.empty()) static_cast<void>(::unlink(path_.c_str()));
    }
    ReadersOutput(const ReadersOutput&) = delete;
    ReadersOutput& operator=(const ReadersOutput&) = delete;

    std::string write(std::string_view lines) override {
        welcome();
        if (lines.size() > kPendingBytesMax) return losses_.add(1, "a line is too long");
        std::string sentence;
        for (Reader& reader : readers_) {
            if (!reader.socket.is_open() || !flush(reader)) continue;
            if (!reader.pending.empty()) {
                std::string said = losses_.add(1, "a reader does not keep up");
                if (!said.empty()) sentence = std::move(said);
                continue;
            }
            const ssize_t sent = ::send(reader.socket.get(), lines.data(), lines.size(), MSG_DONTWAIT | MSG_NOSIGNAL);
            const bool is_full = sent < 0 && (errno == EAGAIN || errno == EINTR);
            if (sent < 0 && !is_full) {
                reader.socket.reset();  // it has left
                continue;
            }
            const std::string_view rest = lines.substr(sent > 0 ? static_cast<std::size_t>(sent) : 0);
            // The rest of a line that was begun comes before any other.
            if (!rest.empty()) reader.pending.assign(rest);
        }
        return sentence;
    }
    std::string problem() const override { return losses_.problem(); }

private:
    struct Reader {
        Descriptor socket;
        std::string pending;
    };

    void welcome() {
        for (int i = 0; i < kAcceptedAtOnceMax; ++i) {
            Descriptor socket(::accept4(listening_.get(), nullptr, nullptr, SOCK_NONBLOCK | SOCK_CLOEXEC));
            if (!socket.is_open()) return;
            const auto free =
                std::find_if(readers_.begin(), readers_.end(), [](const Reader& r) { return !r.socket.is_open(); });
            if (free == readers_.end()) continue;  // turned away
            const int on = 1;                      // of unix sockets it is none of their business
            static_cast<void>(::setsockopt(socket.get(), IPPROTO_TCP, TCP_NODELAY, &on, sizeof on));
            free->socket = std::move(socket);
            free->pending.clear();
        }
    }
    // False: it has left.
    [[nodiscard]] static bool flush(Reader& reader) {
        if (reader.pending.empty()) return true;
        const ssize_t sent =
            ::send(reader.socket.get(), reader.pending.data(), reader.pending.size(), MSG_DONTWAIT | MSG_NOSIGNAL);
        if (sent > 0) reader.pending.erase(0, static_cast<std::size_t>(sent));
        if (sent >= 0 || errno == EAGAIN || errno == EINTR) return true;
        reader.socket.reset();
        return false;
    }
    void say_farewell() {
        timespec now{};
        static_cast<void>(::clock_gettime(CLOCK_MONOTONIC, &now));
        const auto now_ms = [&now] {
            static_cast<void>(::clock_gettime(CLOCK_MONOTONIC, &now));
            return now.tv_sec * 1000 + now.tv_nsec / 1'000'000;
        };
        const auto end_ms = now_ms() + kFarewellMax_ms;
        for (Reader& reader : readers_) {
            while (reader.socket.is_open() && flush(reader) && !reader.pending.empty()) {
                const auto left = end_ms - now_ms();
                pollfd ready{reader.socket.get(), POLLOUT, 0};
                if (left <= 0 || ::poll(&ready, 1, static_cast<int>(left)) != 1) break;
            }
        }
    }

    Descriptor listening_;
    std::string path_;
    std::array<Reader, kReadersMax> readers_;
    Losses losses_;
};

struct Addresses {
    addrinfo* first = nullptr;
    ~Addresses() {
        if (first != nullptr) ::freeaddrinfo(first);
    }
};

// "HOST:PORT", "[::1]:PORT" or, for who listens, "PORT".
[[nodiscard]] bool find_addresses(std::string_view place, int type, Addresses& found, std::string& why) {
    const std::size_t colon = place.rfind(':');
    std::string host(colon == std::string_view::npos ? std::string_view() : place.substr(0, colon));
    const std::string port(colon == std::string_view::npos ? place : place.substr(colon + 1));
    if (host.size() > 2 && host.front() == '[' && host.back() == ']') host = host.substr(1, host.size() - 2);
    const bool is_number = !port.empty() && port.size() <= 5 &&
                           port.find_first_not_of("0123456789") == std::string::npos && std::stoul(port) <= 65535;
    if (!is_number) {
        why = "'" + port + "' is no port; give a number below 65536.";
        return false;
    }
    if (host.empty()) host = "127.0.0.1";
    addrinfo hints{};
    hints.ai_socktype = type;
    hints.ai_flags = AI_NUMERICSERV;
    const int error = ::getaddrinfo(host.c_str(), port.c_str(), &hints, &found.first);
    if (error == 0) return true;
    why = host + ": " + ::gai_strerror(error) + "; is the name right?";
    return false;
}

[[nodiscard]] std::unique_ptr<LineOutput> open_datagrams(const std::string& name, const LineOutputOptions& options,
                                                         std::string& why) {
    Addresses found;
    if (!find_addresses(std::string_view(name).substr(4), SOCK_DGRAM, found, why)) return nullptr;
    for (const addrinfo* at = found.first; at != nullptr; at = at->ai_next) {
        Descriptor socket(::socket(at->ai_family, at->ai_socktype | SOCK_CLOEXEC | SOCK_NONBLOCK, at->ai_protocol));
        if (!socket.is_open() || ::connect(socket.get(), at->ai_addr, at->ai_addrlen) != 0) {
            why = std::string(std::strerror(errno)) + "; is the network there?";
            continue;
        }
        auto output = std::make_unique<DatagramOutput>(name, options);
        output->connect(std::move(socket));
        return output;
    }
    return nullptr;
}

[[nodiscard]] std::unique_ptr<LineOutput> open_tcp(const std::string& name, const LineOutputOptions& options,
                                                   std::string& why) {
    Addresses found;
    if (!find_addresses(std::string_view(name).substr(4), SOCK_STREAM, found, why)) return nullptr;
    for (const addrinfo* at = found.first; at != nullptr; at = at->ai_next) {
        Descriptor socket(::socket(at->ai_family, at->ai_socktype | SOCK_CLOEXEC | SOCK_NONBLOCK, at->ai_protocol));
        const int on = 1;  // a run that has just ended does not keep its port
        if (socket.is_open() && ::setsockopt(socket.get(), SOL_SOCKET, SO_REUSEADDR, &on, sizeof on) == 0 &&
            ::bind(socket.get(), at->ai_addr, at->ai_addrlen) == 0 &&
            ::listen(socket.get(), static_cast<int>(kReadersMax)) == 0) {
            return std::make_unique<ReadersOutput>(name, options, std::move(socket), "");
        }
        why = std::string(std::strerror(errno)) + "; give another port.";
    }
    return nullptr;
}

[[nodiscard]] std::unique_ptr<LineOutput> open_unix(const std::string& name, const LineOutputOptions& options,
                                                    std::string& why) {
    const std::string path = name.substr(5);
    sockaddr_un address{};
    address.sun_family = AF_UNIX;
    if (path.empty() || path.size() >= sizeof address.sun_path) {
        why =
            "the path has to have 1 to " + std::to_string(sizeof address.sun_path - 1) + " bytes; give a shorter one.";
        return nullptr;
    }
    std::memcpy(address.sun_path, path.data(), path.size());
    const auto* const as_any = reinterpret_cast<const sockaddr*>(&address);
    struct stat status {};
    if (::lstat(path.c_str(), &status) == 0) {
        const Descriptor probe(::socket(AF_UNIX, SOCK_STREAM | SOCK_CLOEXEC | SOCK_NONBLOCK, 0));
        if (!S_ISSOCK(status.st_mode)) {
            why = "is there, and is no socket; give another path.";
            return nullptr;
        }
        if (::connect(probe.get(), as_any, sizeof address) == 0 || errno != ECONNREFUSED) {
            why = "is another program's socket; give another path.";
            return nullptr;
        }
        static_cast<void>(::unlink(path.c_str()));  // of a run that was killed
    }
    Descriptor socket(::socket(AF_UNIX, SOCK_STREAM | SOCK_CLOEXEC | SOCK_NONBLOCK, 0));
    if (!socket.is_open() || ::bind(socket.get(), as_any, sizeof address) != 0 ||
        ::listen(socket.get(), static_cast<int>(kReadersMax)) != 0) {
        why = std::string(std::strerror(errno)) + "; give another path.";
        return nullptr;
    }
    return std::make_unique<ReadersOutput>(name, options, std::move(socket), path);
}

}  // namespace

bool is_file_destination(std::string_view destination) noexcept {
    return !destination.starts_with("unix:") && !destination.starts_with("tcp:") && !destination.starts_with("udp:");
}

std::unique_ptr<LineOutput> open_line_output(const std::string& destination, const LineOutputOptions& options,
                                             std::string& message) {
    std::string why;
    std::unique_ptr<LineOutput> output;
    if (destination.starts_with("udp:")) {
        output = open_datagrams(destination, options, why);
    } else if (destination.starts_with("tcp:")) {
        output = open_tcp(destination, options, why);
    } else if (destination.starts_with("unix:")) {
        output = open_unix(destination, options, why);
    } else {
        auto file = std::make_unique<FileOutput>();
        if (file->open(destination, options, message)) return file;
        return nullptr;
    }
    if (output == nullptr) message = std::string(options.option) + " " + destination + ": " + why;
    return output;
}

}  // namespace stillmesh
