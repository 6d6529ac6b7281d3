// One opening of a camera: opens, reads, pairs the images by time, puts the newest pair into one slot, closes; on a
// thread of its own, or step by step on the caller's. The camera takes pairs out of the slot on its own thread.
#pragma once

#include <condition_variable>
#include <cstdint>
#include <memory>
#include <mutex>
#include <string>

#include "hal/live/device_clock.hpp"
#include "hal/live/frame_pairer.hpp"
#include "hal/v4l2/opening.hpp"
#include "hal/v4l2/v4l2_camera.hpp"

namespace stillmesh::v4l2 {

// Nothing in it refers to the camera: if closing hangs, it is left behind with the thread that hangs.
struct Session {
    using Pairer = FramePairer<Image>;
    struct Pair {
        Image colour, depth;
        std::int64_t colour_us = 0, depth_us = 0;
        std::int64_t taken_ns = 0;     // the colour image, on the host's clock
        std::int64_t complete_ns = 0;  // the pair was there
        [[nodiscard]] bool is_full() const noexcept { return colour.is_held(); }
    };

    Session(std::shared_ptr<V4l2Link> given_link, OpeningWishes given_wishes)
        : link(std::move(given_link)), wishes(std::move(given_wishes)), opening(*link) {}
    ~Session() { close(); }
    Session(const Session&) = delete;
    Session& operator=(const Session&) = delete;

    // Of the thread that serves; the camera reads it once it is opened or closed.
    std::shared_ptr<V4l2Link> link;
    OpeningWishes wishes;
    Opening opening;  // before whoever holds images of it
    Opened opened;
    Status status = Status::kUnavailable;
    std::string message;

    mutable std::mutex mutex;  // of all below; no call of the link is made under it
    std::condition_variable changed;
    bool is_opened = false, is_closing = false, is_closed = false;
    const char* gone_why = nullptr;  // null: it is there
    Pairer pairer{33'333};
    Pair slot, given;
    DeviceClock clock;
    ArrivalForecast forecast;
    std::int64_t time_shift_ns = 0;  // of stamps to the time of day
    bool has_time_shift = false;
    std::int64_t colour_arrival_ns = 0, depth_arrival_ns = 0;  // of the last image of either
    std::int64_t broken_ns = 0;                                // when an image came last that could not be used
    V4l2Counts counts;

    void open();
    // What has come within timeout_ms, all of it.
    void read(std::uint32_t timeout_ms);
    void close() noexcept;
    // All of it until it is told to close.
    void serve(const std::function<void()>& thread_begins) noexcept;

private:
    // What a stream gave, with the lock; false: nothing more is there.
    [[nodiscard]] bool add(bool is_colour, int error, Image image, std::int64_t arrival_ns);
    void pair(std::optional<Pairer::Pair> made, std::int64_t arrival_ns);
};

}  // namespace stillmesh::v4l2
