#include "hal/v4l2/image_clock.hpp"

#include <algorithm>
#include <cstdlib>

namespace stillmesh::v4l2 {

std::int64_t ImageClock::stamp_us(bool is_colour, std::int64_t driver_us,
                                  std::optional<std::uint32_t> device_us) noexcept {
    Stream& stream = streams_[is_colour ? 1 : 0];
    if (!device_us) return driver_us - stream.lag_us;
    if (!has_seen_) last_us_ = *device_us;
    has_seen_ = true;
    const std::int64_t device = last_us_ + static_cast<std::int32_t>(*device_us - static_cast<std::uint32_t>(last_us_));
    const bool is_even = stream.has_last && is_whole_periods(stream, device);
    if (!has_begun_ && is_even) base_us_ = driver_us - device;
    has_begun_ = has_begun_ || is_even;
    const std::int64_t late_us = driver_us - device - base_us_ - stream.lag_us;
    const bool is_near = !has_begun_ || std::abs(late_us) <= kApart_us;
    const bool is_strange = !is_near || !is_even;
    if (is_strange && !is_followed(is_colour, device, late_us)) return driver_us - stream.lag_us;
    const std::int64_t behind_us = driver_us - device - base_us_;
    const bool is_new = !stream.has_lag || is_strange;
    stream.lag_us = is_new ? behind_us : std::min(behind_us, stream.lag_us + kForget_us);
    stream.has_lag = stream.has_last = true;
    stream.strangers = 0;
    stream.last_us = last_us_ = device;
    return device + base_us_;
}

// A strange time: whether it is to be believed after all, since those before it were as strange.
bool ImageClock::is_followed(bool is_colour, std::int64_t device_us, std::int64_t late_us) noexcept {
    Stream& stream = streams_[is_colour ? 1 : 0];
    if (!stream.has_lag) stream.last_us = device_us;
    stream.has_last = true;
    const bool agrees = stream.strangers > 0 && std::abs(late_us - stream.stranger_us) <= kApart_us;
    stream.strangers = agrees ? stream.strangers + 1 : 1;
    stream.stranger_us = late_us;
    if (!has_begun_ || stream.strangers < kStrangers) return false;
    // Another clock, and not a stream that is only slower than the other: this clock goes on where it stands.
    if (std::abs(late_us) > (stream.has_lag ? kApart_us : kBegin_us)) {
        base_us_ += late_us;
        streams_[is_colour ? 0 : 1].has_lag = false;
    }
    return true;
}

bool ImageClock::is_whole_periods(const Stream& stream, std::int64_t device_us) noexcept {
    if (stream.period_us <= 0) return true;
    return (std::abs(device_us - stream.last_us) + kUneven_us) % stream.period_us <= 2 * kUneven_us;
}

}  // namespace stillmesh::v4l2
