// The program as a service: what systemd is told (ready, alive, stopping; a datagram each, nothing when nobody asked),
// how grave a line of its journal is, and what the kernel is asked for in real time.
#pragma once

#include <cstdint>
#include <string>
#include <string_view>

namespace stillmesh {

// Reads NOTIFY_SOCKET and WATCHDOG_USEC of the environment; without the first, says nothing to nobody.
class ServiceNotifier {
public:
    ServiceNotifier();
    ~ServiceNotifier();
    ServiceNotifier(const ServiceNotifier&) = delete;
    ServiceNotifier& operator=(const ServiceNotifier&) = delete;

    void ready() { say("READY=1"); }
    void stopping() { say("STOPPING=1"); }
    // May be called every frame: speaks three times per watchdog period. `now_ns` of monotonic_ns.
    void alive(std::int64_t now_ns);

private:
    void say(const char* state);

    int socket_ = -1;
    std::int64_t period_ns_ = 0;  // 0: no watchdog
    std::int64_t last_ns_ = 0;
};

// syslog's numbers, those in use.
enum class LogLevel : std::uint8_t { kCritical = 2, kError = 3, kWarning = 4, kNotice = 5, kInfo = 6 };

// What a line on standard error begins with: "<4>" where it goes into systemd's journal (JOURNAL_STREAM says so), so
// that `journalctl -p warning` finds it; nothing anywhere else.
[[nodiscard]] const char* log_prefix(LogLevel level) noexcept;
// A sentence of one or more lines, each with that beginning: a journal takes every line for an entry of its own.
[[nodiscard]] std::string log_entry(LogLevel level, std::string_view lines);

// Memory stays in memory, and this thread goes before ordinary ones (SCHED_FIFO). Empty when both were granted, else a
// sentence about what was not and what would help; the program then runs on as an ordinary one.
[[nodiscard]] std::string become_realtime();

// For the thread that reads a camera: before the one of become_realtime(), since it mostly sleeps, and what it brings
// is waited for. Threads that it starts, a driver's, go with it. Nothing happens where that is not granted.
void become_realtime_reader() noexcept;

}  // namespace stillmesh
