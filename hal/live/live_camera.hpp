// A camera that is plugged in, or a file or topics in its place, whichever library drives it: a DepthCamera that says
// what it is and what it counted.
#pragma once

#include <algorithm>
#include <cstdint>
#include <optional>
#include <string>
#include <vector>

#include "hal/depth_camera.hpp"
#include "hal/live/frame_pairer.hpp"
#include "hal/live/frame_times.hpp"

namespace stillmesh {

struct LiveCounts {
    PairingCounts pairing;
    std::uint64_t images_colour = 0, images_depth = 0;  // brought by the driver
    std::uint64_t images_missing = 0;                   // never came: lost before us
    std::uint64_t images_unusable = 0;                  // came damaged: no poll was told of them
    std::uint64_t dropped = 0;                          // pairs overtaken by newer ones before they were polled
    std::uint64_t images_exposed = 0;                   // whose exposure the camera told
    std::uint64_t exposure_sum_us = 0;                  // of those
    std::int64_t reader_cpu_ns = 0;                     // of the thread that reads
    std::int64_t poll_cpu_ns = 0;                       // of poll(), on the caller's thread

    void add(const LiveCounts& other) noexcept {
        pairing.add(other.pairing);
        images_colour += other.images_colour;
        images_depth += other.images_depth;
        images_missing += other.images_missing;
        images_unusable += other.images_unusable;
        dropped += other.dropped;
        images_exposed += other.images_exposed;
        exposure_sum_us += other.exposure_sum_us;
        reader_cpu_ns += other.reader_cpu_ns;
        poll_cpu_ns += other.poll_cpu_ns;
    }
};

class LiveCamera : public DepthCamera, public FrameTimes {
public:
    LiveCamera() = default;
    virtual ~LiveCamera() = default;
    LiveCamera(const LiveCamera&) = delete;
    LiveCamera& operator=(const LiveCamera&) = delete;

    // Why the last call failed.
    [[nodiscard]] virtual std::string message() const = 0;
    // What is known of a silence, such as which stream it is, or images that cannot be used; empty: nothing.
    [[nodiscard]] virtual std::string silence() const { return {}; }
    // What a user should know of what has come since it was opened, each sentence once; empty: nothing new.
    [[nodiscard]] virtual std::string remark() { return {}; }
    // A recording: every frame in order, as fast as it is asked for.
    [[nodiscard]] virtual bool is_file() const { return false; }
    // Once it is open: device, modes, who registers; where its calibration is from; what else a user should know.
    [[nodiscard]] virtual std::string device() const = 0;
    [[nodiscard]] virtual std::string calibration_source() const = 0;
    [[nodiscard]] virtual std::vector<std::string> notes() const { return {}; }
    [[nodiscard]] virtual std::uint64_t frames_expected() const { return 0; }  // pairs at most; 0: unknown
    // Where on the USB it is, for a reset, as the driver names it; empty: the only one; none: not on the USB.
    [[nodiscard]] virtual std::optional<std::string> usb_place() const { return std::nullopt; }
    // Over all openings.
    [[nodiscard]] virtual LiveCounts counts() const noexcept = 0;

    [[nodiscard]] std::uint64_t dropped() noexcept final { return counts().dropped; }

protected:
    [[nodiscard]] std::int64_t period_ns() const noexcept {
        return static_cast<std::int64_t>(1e9 / std::max(info().frames_per_s, 1.0));
    }
};

}  // namespace stillmesh
