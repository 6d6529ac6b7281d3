// Any camera, served as a live one would serve it: every frame comes at its recorded time, not before; whoever is late
// gets the newest that is due, and what was due before it is dropped and counted. A thread polls the source ahead of
// time and copies its frames, as a driver would, so that decoding is not the engine's time. A source that cannot keep
// up (a simulation renders slower than it plays) is no lateness of the engine's: the clock then waits for the source.
// Memory: kSlots frames, taken in open().
#pragma once

#include <array>
#include <condition_variable>
#include <cstdint>
#include <functional>
#include <mutex>
#include <thread>
#include <vector>

#include "hal/depth_camera.hpp"
#include "hal/live/frame_times.hpp"

namespace stillmesh {

// Any clock that does not go backwards; tests bring one that nobody has to wait for.
struct RealtimeClock {
    std::function<std::int64_t()> now_ns;
    std::function<void(std::int64_t)> sleep_until_ns;
};

class RealtimeCamera final : public DepthCamera, public FrameTimes {
public:
    static constexpr std::size_t kSlots = 6;

    // `source` is open, outlives this camera, and is nobody else's from open() to close().
    RealtimeCamera(DepthCamera& source, RealtimeClock clock);
    ~RealtimeCamera();
    RealtimeCamera(const RealtimeCamera&) = delete;
    RealtimeCamera& operator=(const RealtimeCamera&) = delete;

    // kOk; kUnavailable: no memory or no thread.
    [[nodiscard]] Status open() noexcept override;
    [[nodiscard]] const CameraInfo& info() const noexcept override { return source_.info(); }
    // kOk: the newest frame that is due; kTimedOut: none is; and what the source said instead of a frame, in its place
    // (kEnd, kCorrupt, ...): the source then rests until the next poll, so that its message can be read.
    [[nodiscard]] Status poll(Frame& frame) noexcept override;
    [[nodiscard]] Status wait(std::uint32_t timeout_ms) noexcept override;
    void close() noexcept override;

    // When the last frame given out was due: the begin of its latency.
    [[nodiscard]] std::int64_t due_ns() const noexcept override { return given_due_ns_; }
    // When the next frame is due; a frame period from now if the source does not have it yet.
    [[nodiscard]] std::int64_t next_due_ns() noexcept override;
    [[nodiscard]] std::uint64_t dropped() noexcept override;
    // How long the clock waited for the source.
    [[nodiscard]] std::int64_t source_late_ns() noexcept;
    // Whether all that is due has been polled from the source.
    [[nodiscard]] bool is_ahead() noexcept;

private:
    struct Slot {
        Status status = Status::kOk;
        Frame frame;
        std::vector<std::uint8_t> colour;
        std::vector<std::uint16_t> depth;
        std::vector<std::uint8_t> mask;
    };
    void read_source();
    void fill(Slot& slot, const Frame& frame);
    // With the mutex held. `i` counts from the oldest that has not been given out.
    [[nodiscard]] Slot& ready(std::size_t i) noexcept { return slots_[(first_ + (is_given_ ? 1 : 0) + i) % kSlots]; }
    [[nodiscard]] std::size_t ready_count() const noexcept { return taken_ - (is_given_ ? 1 : 0); }
    [[nodiscard]] std::int64_t due_of(const Slot& slot) const noexcept;
    [[nodiscard]] bool is_due(const Slot& slot) const noexcept;
    // Whether the oldest has been overtaken by another that is due.
    [[nodiscard]] bool is_oldest_late() noexcept;
    void drop_oldest() noexcept;

    DepthCamera& source_;
    RealtimeClock clock_;
    std::array<Slot, kSlots> slots_;
    std::mutex mutex_;  // of all below
    std::condition_variable changed_;
    std::size_t first_ = 0;
    std::size_t taken_ = 0;  // one of them given out, if is_given_
    bool is_given_ = false;
    bool is_resting_ = false;  // the source, until its status has been given out and the next poll comes
    bool is_closing_ = false;
    bool has_epoch_ = false;
    std::int64_t epoch_ns_ = 0;        // on the clock
    std::int64_t epoch_frame_ns_ = 0;  // in the frames' time
    std::int64_t source_late_ns_ = 0;
    std::uint64_t dropped_ = 0;
    std::int64_t given_due_ns_ = 0;  // of the thread that polls
    std::thread thread_;
};

}  // namespace stillmesh
