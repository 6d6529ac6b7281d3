#include "platform/linux/process.hpp"

#include <sys/resource.h>
#include <time.h>
#include <unistd.h>

#include <csignal>
#include <cstdio>
#include <cstring>

namespace stillmesh {
namespace {

volatile std::sig_atomic_t caught_signal = 0;
volatile std::sig_atomic_t is_reopen_wanted = 0;

void remember(int signal) {
    caught_signal = signal;
}

void want_reopen(int) {
    is_reopen_wanted = 1;
}

}  // namespace

std::int64_t monotonic_ns() noexcept {
    timespec now{};
    static_cast<void>(::clock_gettime(CLOCK_MONOTONIC, &now));
    return std::int64_t{now.tv_sec} * 1'000'000'000 + now.tv_nsec;
}

void sleep_until_ns(std::int64_t time_ns) noexcept {
    timespec until{};
    until.tv_sec = static_cast<time_t>(time_ns / 1'000'000'000);
    until.tv_nsec = static_cast<long>(time_ns % 1'000'000'000);
    static_cast<void>(::clock_nanosleep(CLOCK_MONOTONIC, TIMER_ABSTIME, &until, nullptr));
}

double cpu_seconds() noexcept {
    rusage usage{};
    if (::getrusage(RUSAGE_SELF, &usage) != 0) return 0.0;
    const auto seconds = [](const timeval& t) {
        return static_cast<double>(t.tv_sec) + static_cast<double>(t.tv_usec) * 1e-6;
    };
    return seconds(usage.ru_utime) + seconds(usage.ru_stime);
}

std::size_t peak_resident_bytes() noexcept {
    std::FILE* const file = std::fopen("/proc/self/status", "r");
    if (file == nullptr) return 0;
    char line[256];
    unsigned long kib = 0;
    while (std::fgets(line, sizeof(line), file) != nullptr) {
        if (std::strncmp(line, "VmHWM:", 6) == 0 && std::sscanf(line + 6, "%lu", &kib) == 1) break;
    }
    static_cast<void>(std::fclose(file));
    return static_cast<std::size_t>(kib) * 1024;
}

void catch_stop_signals() noexcept {
    struct sigaction action {};
    action.sa_handler = remember;
    static_cast<void>(sigemptyset(&action.sa_mask));
    action.sa_flags = static_cast<int>(SA_RESETHAND | static_cast<unsigned>(SA_RESTART));
    static_cast<void>(::sigaction(SIGINT, &action, nullptr));
    static_cast<void>(::sigaction(SIGTERM, &action, nullptr));
}

void release_stop_signals() noexcept {
    static_cast<void>(std::signal(SIGINT, SIG_DFL));
    static_cast<void>(std::signal(SIGTERM, SIG_DFL));
}

void ignore_write_signals() noexcept {
    static_cast<void>(std::signal(SIGPIPE, SIG_IGN));
    static_cast<void>(std::signal(SIGXFSZ, SIG_IGN));
}

int stop_signal() noexcept {
    return caught_signal;
}

void catch_reopen_signal() noexcept {
    if (::isatty(STDERR_FILENO) != 0) return;
    struct sigaction action {};
    if (::sigaction(SIGHUP, nullptr, &action) == 0 && action.sa_handler == SIG_IGN) return;  // nohup
    action = {};
    action.sa_handler = want_reopen;
    static_cast<void>(sigemptyset(&action.sa_mask));
    action.sa_flags = SA_RESTART;
    static_cast<void>(::sigaction(SIGHUP, &action, nullptr));
}

bool take_reopen_signal() noexcept {
    if (is_reopen_wanted == 0) return false;
    is_reopen_wanted = 0;
    return true;
}

}  // namespace stillmesh
