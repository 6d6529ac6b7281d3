// The time of each image: by the camera's own clock where its metadata has it, else by the driver's stamp less the
// delay that such stamps have had. One clock for both streams, which begins where the driver's stamps stand, goes on as
// the camera's does and never jumps, whichever images have metadata. A time that the driver's stamp contradicts, or
// that is no whole number of periods after the one before, is a damaged one, and not believed; three in a row that
// agree are a clock that was set anew. Right to microseconds between images with metadata (a damaged one that fits may
// be 2 ms off); without it, to the jitter of the bus.
#pragma once

#include <cstdint>
#include <optional>

namespace stillmesh::v4l2 {

class ImageClock {
public:
    // The time between two images of each stream.
    ImageClock(std::int64_t depth_period_us, std::int64_t colour_period_us) noexcept {
        streams_[0].period_us = depth_period_us;
        streams_[1].period_us = colour_period_us;
    }
    // `driver_us`: the driver's stamp, on the host's clock; `device_us`: the camera's, which wraps at 2^32.
    [[nodiscard]] std::int64_t stamp_us(bool is_colour, std::int64_t driver_us,
                                        std::optional<std::uint32_t> device_us) noexcept;
    // The camera's clock has been believed once: stamps go as it does.
    [[nodiscard]] bool is_device_clock() const noexcept { return has_begun_; }

private:
    // Delays on the way vary by less, on a host that is not overrun; and those of two streams differ by less.
    static constexpr std::int64_t kApart_us = 20'000, kBegin_us = 500'000;
    static constexpr std::int64_t kUneven_us = 2'000;  // images lie so far from a beat at most
    static constexpr std::int64_t kForget_us = 4;      // per image: clocks up to 120 ppm apart are followed
    static constexpr std::uint32_t kStrangers = 3;

    struct Stream {
        std::int64_t period_us = 0;
        bool has_lag = false, has_last = false;
        std::int64_t lag_us = 0;   // of the driver's stamps behind this clock: the smallest of late
        std::int64_t last_us = 0;  // the camera's clock at the image before
        std::uint32_t strangers = 0;
        std::int64_t stranger_us = 0;
    };

    [[nodiscard]] bool is_followed(bool is_colour, std::int64_t device_us, std::int64_t late_us) noexcept;
    [[nodiscard]] static bool is_whole_periods(const Stream& stream, std::int64_t device_us) noexcept;

    Stream streams_[2];
    bool has_seen_ = false, has_begun_ = false;
    std::int64_t last_us_ = 0;  // the camera's clock without its wraps
    std::int64_t base_us_ = 0;  // this clock less the camera's
};

}  // namespace stillmesh::v4l2
