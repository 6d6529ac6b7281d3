// The host's clocks as live cameras use them, and the processor time that a thread takes.
#pragma once

#include <time.h>

#include <cstdint>

namespace stillmesh::live {

[[nodiscard]] inline std::int64_t clock_ns(clockid_t clock) noexcept {
    timespec now{};
    static_cast<void>(::clock_gettime(clock, &now));
    return std::int64_t{now.tv_sec} * 1'000'000'000 + now.tv_nsec;
}

[[nodiscard]] inline std::int64_t monotonic_ns() noexcept {
    return clock_ns(CLOCK_MONOTONIC);
}

// What is added to the monotonic clock to get the time of day. Asked once per process: a camera that is opened again
// goes on in the same time, whatever happens to the time of day.
[[nodiscard]] inline std::int64_t unix_minus_monotonic_ns() noexcept {
    static const std::int64_t kOffset_ns = clock_ns(CLOCK_REALTIME) - monotonic_ns();
    return kOffset_ns;
}

// Stamps of a camera's clock as times of day: they go by the camera's clock, from where its first frame was taken.
class TimeOfDay {
public:
    void begin(std::int64_t stamp_us, std::int64_t taken_ns) noexcept {
        if (has_begun_) return;
        has_begun_ = true;
        shift_ns_ = unix_minus_monotonic_ns() + taken_ns - stamp_us * 1000;
    }
    [[nodiscard]] std::int64_t unix_ns(std::int64_t stamp_us) const noexcept { return stamp_us * 1000 + shift_ns_; }

private:
    bool has_begun_ = false;
    std::int64_t shift_ns_ = 0;
};

// Processor time of this thread between construction and destruction, added to a sum.
class CpuMeter {
public:
    explicit CpuMeter(std::int64_t& sum_ns) noexcept : sum_ns_(sum_ns), begin_ns_(clock_ns(CLOCK_THREAD_CPUTIME_ID)) {}
    ~CpuMeter() { sum_ns_ += clock_ns(CLOCK_THREAD_CPUTIME_ID) - begin_ns_; }
    CpuMeter(const CpuMeter&) = delete;
    CpuMeter& operator=(const CpuMeter&) = delete;

private:
    std::int64_t& sum_ns_;
    std::int64_t begin_ns_;
};

}  // namespace stillmesh::live
