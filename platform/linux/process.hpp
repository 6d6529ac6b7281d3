// What a program asks the operating system about itself: time, processor seconds, memory, and whether to stop.
#pragma once

#include <cstddef>
#include <cstdint>

namespace stillmesh {

// Never goes backwards; its zero means nothing.
[[nodiscard]] std::int64_t monotonic_ns() noexcept;
// Until a time of monotonic_ns, or a signal.
void sleep_until_ns(std::int64_t time_ns) noexcept;
// User and system time of all threads.
[[nodiscard]] double cpu_seconds() noexcept;
// The most this process has had in memory (VmHWM; getrusage would count what ran before exec too). 0: unknown.
[[nodiscard]] std::size_t peak_resident_bytes() noexcept;

// A pipe whose reader left (SIGPIPE) and a file at its size limit (SIGXFSZ) are failed writes from now on, and end
// nothing.
void ignore_write_signals() noexcept;
// From now on the first SIGINT or SIGTERM only sets stop_signal(); a second one ends the program at once.
void catch_stop_signals() noexcept;
// From now on they end the program at once again: everything is written.
void release_stop_signals() noexcept;
// 0, or the signal that asked us to finish.
[[nodiscard]] int stop_signal() noexcept;

// From now on SIGHUP only makes take_reopen_signal() true, once. Not where standard error is a terminal: there SIGHUP
// means that the terminal is gone, and ends the program as ever.
void catch_reopen_signal() noexcept;
[[nodiscard]] bool take_reopen_signal() noexcept;

}  // namespace stillmesh
