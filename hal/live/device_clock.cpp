#include "hal/live/device_clock.hpp"

#include <algorithm>

namespace stillmesh {

std::int64_t DeviceClock::host_ns(std::int64_t stamp_us, std::int64_t arrival_ns) noexcept {
    // Within +-146 years: sums of it do not overflow, whatever a device says.
    const std::int64_t stamp_ns = std::clamp<std::int64_t>(stamp_us, 0, std::int64_t{1} << 52) * 1000;
    const std::int64_t offset_ns = arrival_ns - stamp_ns;
    const std::int64_t apart_ns = offset_ns - offset_ns_;
    if (!has_offset_ || apart_ns > kRestart_ns || apart_ns < -kRestart_ns) {
        has_offset_ = true;
        is_host_clock_ = !is_apart_ && offset_ns >= 0 && offset_ns < kSameClock_ns;
        window_begin_ns_ = arrival_ns;
        offset_ns_ = next_offset_ns_ = is_host_clock_ ? 0 : offset_ns;
    }
    if (is_host_clock_) {
        if (offset_ns >= 0) return stamp_ns;
        is_host_clock_ = false;  // a frame before it arrived: they only looked alike
        offset_ns_ = next_offset_ns_ = offset_ns;
    }
    if (arrival_ns - window_begin_ns_ > kWindow_ns) {
        window_begin_ns_ = arrival_ns;
        offset_ns_ = std::min(next_offset_ns_, offset_ns);
        next_offset_ns_ = offset_ns;
    }
    offset_ns_ = std::min(offset_ns_, offset_ns);
    next_offset_ns_ = std::min(next_offset_ns_, offset_ns);
    return stamp_ns + offset_ns_;
}

void ArrivalForecast::arrived(std::int64_t taken_ns, std::int64_t arrival_ns) noexcept {
    const std::int64_t way_ns = std::max<std::int64_t>(arrival_ns - taken_ns, 0);
    way_ns_ = taken_ns_ == 0 ? way_ns : std::min(way_ns, way_ns_ + kForget_ns);
    taken_ns_ = taken_ns;
}

}  // namespace stillmesh
