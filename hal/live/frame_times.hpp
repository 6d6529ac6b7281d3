// What a camera whose frames come by the clock knows about them, beside the frames: for pacing and for latency. Times
// are the host's monotonic clock.
#pragma once

#include <cstdint>

namespace stillmesh {

class FrameTimes {
public:
    // When the last frame given out was taken, or was due: the begin of its latency.
    [[nodiscard]] virtual std::int64_t due_ns() const noexcept { return 0; }
    // When the next one is expected.
    [[nodiscard]] virtual std::int64_t next_due_ns() noexcept { return 0; }
    // Frames that came and were overtaken by newer ones before they were polled.
    [[nodiscard]] virtual std::uint64_t dropped() noexcept { return 0; }

protected:
    ~FrameTimes() = default;
};

}  // namespace stillmesh
