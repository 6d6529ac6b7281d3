#include "platform/linux/service.hpp"

#include <sched.h>
#include <sys/mman.h>
#include <sys/socket.h>
#include <sys/stat.h>
#include <sys/un.h>
#include <unistd.h>

#include <algorithm>
#include <charconv>
#include <cstddef>
#include <cstdio>
#include <cstdlib>
#include <cstring>

namespace stillmesh {
namespace {

// Above ordinary threads, below the kernel's own interrupt threads (50).
constexpr int kPriority = 10;

}  // namespace

ServiceNotifier::ServiceNotifier() {
    const char* const name = std::getenv("NOTIFY_SOCKET");
    if (name == nullptr || (name[0] != '/' && name[0] != '@')) return;
    sockaddr_un address{};
    address.sun_family = AF_UNIX;
    const std::size_t length = std::strlen(name);
    if (length >= sizeof address.sun_path) return;
    std::memcpy(address.sun_path, name, length);
    if (name[0] == '@') address.sun_path[0] = '\0';  // an abstract name
    socket_ = ::socket(AF_UNIX, SOCK_DGRAM | SOCK_CLOEXEC | SOCK_NONBLOCK, 0);
    if (socket_ < 0) return;
    const auto size = static_cast<socklen_t>(offsetof(sockaddr_un, sun_path) + length);
    if (::connect(socket_, reinterpret_cast<const sockaddr*>(&address), size) != 0) {
        static_cast<void>(::close(socket_));
        socket_ = -1;
        return;
    }
    if (const char* const watchdog = std::getenv("WATCHDOG_USEC"); watchdog != nullptr) {
        std::int64_t microseconds = 0;
        std::from_chars(watchdog, watchdog + std::strlen(watchdog), microseconds);
        period_ns_ = std::clamp(microseconds, std::int64_t{0}, std::int64_t{1'000'000'000'000}) * 1000 / 3;
    }
}

ServiceNotifier::~ServiceNotifier() {
    if (socket_ >= 0) static_cast<void>(::close(socket_));
}

void ServiceNotifier::alive(std::int64_t now_ns) {
    if (period_ns_ == 0 || (last_ns_ != 0 && now_ns - last_ns_ < period_ns_)) return;
    last_ns_ = now_ns;
    say("WATCHDOG=1");
}

// Not const: it says something.
// NOLINTNEXTLINE(readability-make-member-function-const)
void ServiceNotifier::say(const char* state) {
    // Never waits: a service manager that does not listen is not worth a frame.
    if (socket_ >= 0) static_cast<void>(::send(socket_, state, std::strlen(state), MSG_NOSIGNAL));
}

const char* log_prefix(LogLevel level) noexcept {
    const char* const stream = std::getenv("JOURNAL_STREAM");
    if (stream == nullptr) return "";
    // Device and inode of what systemd connected; inherited by whoever we start, whose standard error may be another.
    unsigned long long device = 0;
    unsigned long long inode = 0;
    struct stat here {};
    if (std::sscanf(stream, "%llu:%llu", &device, &inode) != 2 || ::fstat(STDERR_FILENO, &here) != 0 ||
        here.st_dev != device || here.st_ino != inode) {
        return "";
    }
    constexpr const char* kPrefixes[] = {"<0>", "<1>", "<2>", "<3>", "<4>", "<5>", "<6>"};
    return kPrefixes[static_cast<std::size_t>(level)];
}

std::string log_entry(LogLevel level, std::string_view lines) {
    const std::string prefix = log_prefix(level);
    std::string entry;
    while (!lines.empty()) {
        const std::string_view line = lines.substr(0, lines.find('\n'));
        entry.append(prefix).append(line).push_back('\n');
        lines.remove_prefix(std::min(line.size() + 1, lines.size()));
    }
    return entry;
}

std::string become_realtime() {
    std::string refused;
    // On fault: what was never touched (other threads' stacks) need not be there.
    if (::mlockall(MCL_CURRENT | MCL_ONFAULT) != 0) refused = "its memory may be swapped out (LimitMEMLOCK=infinity)";
    sched_param parameter{};
    parameter.sched_priority = kPriority;
    if (::sched_setscheduler(0, SCHED_FIFO | SCHED_RESET_ON_FORK, &parameter) != 0) {
        if (!refused.empty()) refused += ", and ";
        refused += "other programs may delay it (LimitRTPRIO=20, or run it as root)";
    }
    if (refused.empty()) return refused;
    return "real time without the kernel's help: " + refused + ".";
}

void become_realtime_reader() noexcept {
    sched_param parameter{};
    parameter.sched_priority = kPriority + 1;
    static_cast<void>(::sched_setscheduler(0, SCHED_FIFO, &parameter));
}

}  // namespace stillmesh
