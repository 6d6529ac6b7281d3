// The last look at a live camera's frame before the engine: its size and format are the camera's, its time goes on.
// Single frames with impossible times (backwards, repeated, far away) are dropped; a clock that has restarted is
// carried on by the host's clock, so that the engine sees one time from start to end. Also says when an image is
// frozen: a sensor has noise, the same bytes again and again are an image that nobody takes any more
// (stream_watch.hpp).
#pragma once

#include <cstdint>

#include "hal/depth_camera.hpp"
#include "hal/live/stream_watch.hpp"

namespace stillmesh {

struct GuardCounts {
    std::uint64_t wrong_form = 0;      // another size, format or unit than the camera's
    std::uint64_t wrong_time = 0;      // dropped for its time
    std::uint64_t clock_restarts = 0;  // carried on by the host's clock
};

class FrameGuard {
public:
    // `has_host_clock`: arrival times mean something; else (a recording, as fast as it goes) only frame times do.
    FrameGuard(const CameraInfo& info, bool has_host_clock) noexcept : info_(info), has_host_clock_(has_host_clock) {}

    // The camera was opened again: its clock may be any. Its times so far stay behind.
    void reopened() noexcept;
    // kOk: go on with it; its times may have been moved. kCorrupt: drop it; kInvalid: not the camera's form, drop it.
    [[nodiscard]] Status admit(Frame& frame, std::int64_t arrival_ns) noexcept;
    // How long the admitted images of a stream have been the same, by their own times.
    [[nodiscard]] std::int64_t frozen_ns() const noexcept { return frozen_ns_; }
    [[nodiscard]] const GuardCounts& counts() const noexcept { return counts_; }

private:
    // Frames that agree with each other about another time than expected, before they are believed.
    static constexpr std::uint32_t kRestartFrames = 3;
    static constexpr std::int64_t kJump_ns = 500'000'000;

    [[nodiscard]] bool has_right_form(const Frame& frame) const noexcept;
    // Whether `time_ns` can follow another frame's.
    [[nodiscard]] bool follows(std::int64_t time_ns, std::int64_t arrival_ns, std::int64_t before_ns,
                               std::int64_t before_arrival_ns) const noexcept;

    CameraInfo info_;
    bool has_host_clock_;
    bool has_last_ = false;
    bool is_reopened_ = false;
    std::int64_t shift_ns_ = 0;     // what is added to the camera's times
    std::int64_t last_ns_ = 0;      // of the last admitted frame, as the camera says
    std::int64_t last_out_ns_ = 0;  // and as it went on
    std::int64_t last_arrival_ns_ = 0;
    std::uint32_t strangers_ = 0;  // in a row, agreeing with each other
    std::int64_t first_stranger_ns_ = 0;
    std::int64_t stranger_ns_ = 0;
    std::int64_t stranger_arrival_ns_ = 0;
    StreamWatch streams_;
    std::int64_t same_since_ns_ = 0;
    std::int64_t frozen_ns_ = 0;
    GuardCounts counts_;
};

}  // namespace stillmesh
