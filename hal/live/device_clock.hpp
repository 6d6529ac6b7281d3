// Where a camera's timestamps lie on the host's clock. A stamp plus the smallest offset seen lately between a stamp and
// the arrival of its frame: what comes on top of it is delay on the way (bus, driver, threads), not the camera's time.
// The window moves, because the two clocks drift apart. A driver that stamps with the host's own monotonic clock is
// recognised, and its stamps are taken as they are: then the delay of the fastest frame counts too.
#pragma once

#include <cstdint>

namespace stillmesh {

class DeviceClock {
public:
    // Begins anew: the device was opened.
    void reset() noexcept { *this = DeviceClock(); }
    // When the frame was stamped, on the host's clock; never after its arrival.
    [[nodiscard]] std::int64_t host_ns(std::int64_t stamp_us, std::int64_t arrival_ns) noexcept;
    // The stamps are the device's own clock, however near the host's it began: its drift is followed.
    void keep_apart() noexcept {
        if (is_apart_) return;
        is_apart_ = true;
        if (is_host_clock_) is_host_clock_ = has_offset_ = false;
    }
    // Stamps of this clock are the host's monotonic clock.
    [[nodiscard]] bool is_host_clock() const noexcept { return is_host_clock_; }

private:
    static constexpr std::int64_t kWindow_ns = 10'000'000'000;
    static constexpr std::int64_t kSameClock_ns = 100'000'000;  // stamps this close behind arrival: the host's clock
    static constexpr std::int64_t kRestart_ns = 1'000'000'000;  // offsets this far apart: another clock

    bool has_offset_ = false;
    bool is_host_clock_ = false;
    bool is_apart_ = false;
    std::int64_t window_begin_ns_ = 0;
    std::int64_t offset_ns_ = 0;       // smallest of the window before and of this one
    std::int64_t next_offset_ns_ = 0;  // smallest of this one
};

// When the next pair is expected: a period after the last was taken, and on the way as long as the fastest of late. A
// pair that comes late says nothing about the next: whoever works until then must not be late for it too.
class ArrivalForecast {
public:
    void reset() noexcept { *this = ArrivalForecast(); }
    void arrived(std::int64_t taken_ns, std::int64_t arrival_ns) noexcept;
    // 0: none has arrived yet.
    [[nodiscard]] std::int64_t next_ns(std::int64_t period_ns) const noexcept {
        return taken_ns_ == 0 ? 0 : taken_ns_ + way_ns_ + period_ns;
    }

private:
    static constexpr std::int64_t kForget_ns = 50'000;  // per pair: ways that grow are believed slowly

    std::int64_t taken_ns_ = 0;
    std::int64_t way_ns_ = 0;
};

}  // namespace stillmesh
