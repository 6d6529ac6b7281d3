// The clocks of this room: a clock in ns, and the processor time that a thread takes.
#pragma once

#include <time.h>

#include <cstdint>

namespace stillmesh::openni2 {

[[nodiscard]] inline std::int64_t clock_ns(clockid_t clock) noexcept {
    timespec now{};
    static_cast<void>(::clock_gettime(clock, &now));
    return std::int64_t{now.tv_sec} * 1'000'000'000 + now.tv_nsec;
}

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

}  // namespace stillmesh::openni2
