// One opening of a live camera, between the thread that serves its driver and the one that polls: images become pairs
// by their times, the newest pair waits in one slot, and either thread can tell the other to end. It knows no driver
// and no camera: a driver that hangs keeps it, with the thread that hangs, and the camera is opened anew. Memory: one
// image that waits for its partner, the pair in the slot, the pair given out. No call waits longer than it says.
#pragma once

#include <chrono>
#include <condition_variable>
#include <cstdint>
#include <mutex>
#include <optional>
#include <string>
#include <utility>

#include "hal/live/device_clock.hpp"
#include "hal/live/frame_pairer.hpp"
#include "hal/live/host_clock.hpp"
#include "hal/live/live_camera.hpp"

namespace stillmesh::live {

// `Image` is whatever holds the pixels; it is moved, never copied.
template <typename Image>
struct LiveSession {
    using Pairer = FramePairer<Image>;
    struct Pair {
        Image colour, depth;
        std::int64_t colour_us = 0, depth_us = 0;  // by the camera's clock
        std::int64_t taken_ns = 0;                 // the colour image, by the host's monotonic clock
        std::int64_t complete_ns = 0;              // the pair was there
    };

    mutable std::mutex mutex;  // of all below but `time_of_day`
    std::condition_variable changed;
    bool is_opened = false, is_closing = false, is_closed = false;
    const char* gone_why = nullptr;   // null: it is there
    std::optional<Pair> slot, given;  // the newest; what poll() gave out, its caller's alone until the next
    DeviceClock clock;
    std::int64_t unusable_ns = 0;  // when images came last that cannot be used
    LiveCounts counts;             // but for what the pairer counts
    TimeOfDay time_of_day;         // of the thread that polls

    // Pairs come from now on, so far from each other; their images within `apart_us`, if it is not half of that.
    void begin(std::int64_t period_us, std::int64_t now_ns, std::int64_t apart_us = 0) {
        period_ns_ = period_us * 1000;
        pairing_us_ = apart_us > 0 ? 2 * apart_us : period_us;
        colour_arrival_ns_ = depth_arrival_ns_ = now_ns;
        pair_anew();
    }
    // The images that wait for a partner, for a poll, or for their return go back where they came from.
    void release_images() {
        slot.reset();
        given.reset();
        pair_anew();
    }

    // For the thread that serves, under the mutex. What it returns is a pair that was overtaken in the slot, to be
    // released where its release may wait; `is_pair`: the image made one.
    [[nodiscard]] std::optional<Pair> add(bool is_colour, Image image, std::int64_t stamp_us, std::int64_t arrival_ns,
                                          bool& is_pair) {
        (is_colour ? colour_arrival_ns_ : depth_arrival_ns_) = arrival_ns;
        ++(is_colour ? counts.images_colour : counts.images_depth);
        // Both streams have one clock: each image tells something about it.
        static_cast<void>(clock.host_ns(stamp_us, arrival_ns));
        auto made =
            is_colour ? pairer_.add_colour(std::move(image), stamp_us) : pairer_.add_depth(std::move(image), stamp_us);
        is_pair = made.has_value();
        if (!is_pair) return std::nullopt;
        if (slot) ++counts.dropped;
        Pair pair{std::move(made->colour),
                  std::move(made->depth),
                  made->colour_us,
                  made->depth_us,
                  clock.host_ns(made->colour_us, arrival_ns),
                  arrival_ns};
        forecast_.arrived(pair.taken_ns, arrival_ns);
        std::optional<Pair> overtaken = std::exchange(slot, std::move(pair));
        changed.notify_all();
        return overtaken;
    }

    // For the thread that polls: the newest pair becomes `given`. kTimedOut: none is there; kUnavailable: none, and the
    // camera is gone, `why` says how.
    [[nodiscard]] Status take(std::string& why) {
        const std::lock_guard lock(mutex);
        if (!slot && gone_why == nullptr) return Status::kTimedOut;
        if (!slot) {
            why = gone_why;
            return Status::kUnavailable;
        }
        given = std::exchange(slot, std::nullopt);
        changed.notify_all();
        return Status::kOk;
    }
    // What was given out, to be released without the lock.
    [[nodiscard]] std::optional<Pair> take_back() {
        const std::lock_guard lock(mutex);
        return std::exchange(given, std::nullopt);
    }
    // kOk: a pair is there; kUnavailable: none, and the camera is gone; kTimedOut: neither within so long.
    [[nodiscard]] Status wait(std::uint32_t timeout_ms) {
        static_cast<void>(waits(timeout_ms, [this] { return slot || gone_why != nullptr; }));
        const std::lock_guard lock(mutex);
        return slot ? Status::kOk : gone_why != nullptr ? Status::kUnavailable : Status::kTimedOut;
    }
    // When the next pair is expected; one that waits already came when it came.
    [[nodiscard]] std::int64_t next_due_ns(std::int64_t now_ns) const {
        const std::lock_guard lock(mutex);
        if (slot) return slot->complete_ns;
        const std::int64_t next_ns = forecast_.next_ns(period_ns_);
        return next_ns != 0 ? next_ns : now_ns + period_ns_;
    }

    // Opening has ended, one way or the other; false: not within so long, and it is to end whenever it comes back.
    [[nodiscard]] bool answers_within(std::uint32_t timeout_ms) {
        if (waits(timeout_ms, [this] { return is_opened || is_closed; })) return true;
        const std::lock_guard lock(mutex);
        is_closing = true;
        return false;
    }
    // Tells the thread that serves to end; false: it did not within so long.
    [[nodiscard]] bool closes_within(std::uint32_t timeout_ms) {
        {
            const std::lock_guard lock(mutex);
            is_closing = true;
        }
        changed.notify_all();
        return waits(timeout_ms, [this] { return is_closed; });
    }

    // What explains a silence has happened lately: which of the two streams it is.
    [[nodiscard]] const char* silent_stream() const noexcept {
        const std::int64_t apart_ns = colour_arrival_ns_ - depth_arrival_ns_;
        if (apart_ns > kRecent_ns) return "colour images come, depth images do not";
        if (apart_ns < -kRecent_ns) return "depth images come, colour images do not";
        return "";
    }
    [[nodiscard]] bool has_unusable(std::int64_t now_ns) const noexcept {
        return unusable_ns != 0 && now_ns - unusable_ns < kRecent_ns;
    }

    [[nodiscard]] LiveCounts counted() const noexcept {
        const std::lock_guard lock(mutex);
        LiveCounts sum = counts;
        sum.pairing.add(pairer_.counts());
        return sum;
    }

private:
    static constexpr std::int64_t kRecent_ns = 500'000'000;

    template <typename Condition>
    [[nodiscard]] bool waits(std::uint32_t timeout_ms, const Condition& condition) {
        std::unique_lock lock(mutex);
        return changed.wait_for(lock, std::chrono::milliseconds(timeout_ms), condition);
    }
    void pair_anew() {
        counts.pairing.add(pairer_.counts());
        pairer_ = Pairer(pairing_us_);
    }

    std::int64_t period_ns_ = 33'333'000, pairing_us_ = 33'333;
    Pairer pairer_{33'333};
    ArrivalForecast forecast_;
    std::int64_t colour_arrival_ns_ = 0, depth_arrival_ns_ = 0;
};

}  // namespace stillmesh::live
