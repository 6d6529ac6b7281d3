#include "hal/realtime/realtime_camera.hpp"

#include <algorithm>
#include <chrono>
#include <exception>
#include <utility>

namespace stillmesh {
namespace {

// How long somebody who waits for another clock sleeps before looking again.
constexpr std::chrono::milliseconds kLook{2};

}  // namespace

RealtimeCamera::RealtimeCamera(DepthCamera& source, RealtimeClock clock) : source_(source), clock_(std::move(clock)) {}

RealtimeCamera::~RealtimeCamera() {
    close();
}

Status RealtimeCamera::open() noexcept {
    close();
    try {
        const CameraModel& model = source_.info().model;
        for (Slot& slot : slots_) {
            slot.colour.resize(std::size_t{3} * model.width * model.height);
            slot.depth.resize(std::size_t{model.width} * model.height);
        }
        thread_ = std::thread([this] { read_source(); });
    } catch (const std::exception&) {
        return Status::kUnavailable;
    }
    return Status::kOk;
}

void RealtimeCamera::close() noexcept {
    if (thread_.joinable()) {
        {
            const std::lock_guard lock(mutex_);
            is_closing_ = true;
            changed_.notify_all();
        }
        thread_.join();
    }
    first_ = taken_ = 0;
    is_given_ = is_resting_ = is_closing_ = has_epoch_ = false;
}

std::int64_t RealtimeCamera::due_of(const Slot& slot) const noexcept {
    return epoch_ns_ + (slot.frame.time_ns - epoch_frame_ns_);
}

bool RealtimeCamera::is_due(const Slot& slot) const noexcept {
    return slot.status != Status::kOk || !has_epoch_ || due_of(slot) <= clock_.now_ns();
}

bool RealtimeCamera::is_oldest_late() noexcept {
    return ready_count() >= 2 && ready(0).status == Status::kOk && ready(1).status == Status::kOk && has_epoch_ &&
           is_due(ready(1));
}

void RealtimeCamera::drop_oldest() noexcept {
    if (is_given_) std::swap(slots_[first_], slots_[(first_ + 1) % kSlots]);  // the one given out stays where it is
    // Swapping vectors moves no pixel: the views given out stay valid.
    first_ = (first_ + 1) % kSlots;
    --taken_;
    ++dropped_;
}

void RealtimeCamera::fill(Slot& slot, const Frame& frame) {
    slot.frame = frame;
    const std::size_t row_bytes = std::size_t{frame.colour.width} * channels_of(frame.format);
    slot.colour.resize(row_bytes * frame.colour.height);
    slot.depth.resize(std::size_t{frame.depth.width} * frame.depth.height);
    for (std::uint32_t y = 0; y < frame.colour.height; ++y) {
        std::copy_n(frame.colour.row(y), row_bytes, slot.colour.data() + y * row_bytes);
    }
    for (std::uint32_t y = 0; y < frame.depth.height; ++y) {
        std::copy_n(frame.depth.row(y), frame.depth.width, slot.depth.data() + std::size_t{y} * frame.depth.width);
    }
    const bool has_mask = frame.mask.data != nullptr;
    slot.mask.resize(has_mask ? std::size_t{frame.mask.width} * frame.mask.height : 0);
    for (std::uint32_t y = 0; has_mask && y < frame.mask.height; ++y) {
        std::copy_n(frame.mask.row(y), frame.mask.width, slot.mask.data() + std::size_t{y} * frame.mask.width);
    }
    if (has_mask) slot.frame.mask = {slot.mask.data(), frame.mask.width, frame.mask.height, frame.mask.width};
    slot.frame.colour = {slot.colour.data(), frame.colour.width, frame.colour.height, row_bytes};
    slot.frame.depth = {slot.depth.data(), frame.depth.width, frame.depth.height, frame.depth.width};
}

void RealtimeCamera::read_source() {
    for (;;) {
        std::size_t free = 0;
        {
            std::unique_lock lock(mutex_);
            // Full: a live camera would go on and forget what nobody fetched in time.
            while (!is_closing_ && (is_resting_ || (taken_ == kSlots && !is_oldest_late()))) {
                changed_.wait_for(lock, kLook);
            }
            if (is_closing_) return;
            if (taken_ == kSlots) drop_oldest();
            free = (first_ + taken_) % kSlots;
        }
        Frame frame;
        const std::int64_t begin_ns = clock_.now_ns();
        const Status status = source_.poll(frame);
        if (status == Status::kTimedOut) {
            static_cast<void>(source_.wait(50));
            continue;
        }
        // The slot is free, and only this thread takes free slots; drop_oldest() moves taken ones only.
        slots_[free].status = status;
        if (status == Status::kOk) fill(slots_[free], frame);
        const std::lock_guard lock(mutex_);
        if (status == Status::kOk && ready_count() == 0 && has_epoch_) {
            const std::int64_t now_ns = clock_.now_ns();
            const std::int64_t late_ns = std::clamp<std::int64_t>(now_ns - due_of(slots_[free]), 0,
                                                                  std::max<std::int64_t>(now_ns - begin_ns, 0));
            epoch_ns_ += late_ns;
            source_late_ns_ += late_ns;
        }
        ++taken_;
        is_resting_ = status != Status::kOk;
        changed_.notify_all();
    }
}

Status RealtimeCamera::poll(Frame& frame) noexcept {
    const std::lock_guard lock(mutex_);
    if (is_given_) {
        is_resting_ = is_resting_ && slots_[first_].status == Status::kOk;
        first_ = (first_ + 1) % kSlots;
        --taken_;
        is_given_ = false;
        changed_.notify_all();
    }
    while (is_oldest_late()) drop_oldest();
    if (ready_count() == 0 || !is_due(ready(0))) return Status::kTimedOut;
    Slot& slot = ready(0);
    if (slot.status == Status::kEnd) return Status::kEnd;  // for ever
    is_given_ = true;
    changed_.notify_all();
    if (slot.status != Status::kOk) return slot.status;
    if (!has_epoch_) {
        has_epoch_ = true;
        epoch_ns_ = clock_.now_ns();
        epoch_frame_ns_ = slot.frame.time_ns;
    }
    given_due_ns_ = due_of(slot);
    frame = slot.frame;
    return Status::kOk;
}

Status RealtimeCamera::wait(std::uint32_t timeout_ms) noexcept {
    const std::int64_t until_ns = clock_.now_ns() + std::int64_t{timeout_ms} * 1'000'000;
    for (std::uint32_t looks = 0; clock_.now_ns() < until_ns && looks <= timeout_ms; ++looks) {
        std::int64_t wake_ns = until_ns;
        {
            std::unique_lock lock(mutex_);
            if (ready_count() == 0) {
                changed_.wait_for(lock, kLook);
                continue;
            }
            if (is_due(ready(0))) return Status::kOk;
            wake_ns = std::min(wake_ns, due_of(ready(0)));
        }
        clock_.sleep_until_ns(wake_ns);
    }
    const std::lock_guard lock(mutex_);
    return ready_count() > 0 && is_due(ready(0)) ? Status::kOk : Status::kTimedOut;
}

std::int64_t RealtimeCamera::next_due_ns() noexcept {
    const std::lock_guard lock(mutex_);
    if (ready_count() > 0 && ready(0).status == Status::kOk && has_epoch_) {
        // What is already overtaken will not be given out.
        std::size_t next = 0;
        while (next + 1 < ready_count() && ready(next + 1).status == Status::kOk && is_due(ready(next + 1))) ++next;
        return due_of(ready(next));
    }
    return clock_.now_ns() + static_cast<std::int64_t>(1e9 / source_.info().frames_per_s);
}

std::uint64_t RealtimeCamera::dropped() noexcept {
    const std::lock_guard lock(mutex_);
    return dropped_;
}

std::int64_t RealtimeCamera::source_late_ns() noexcept {
    const std::lock_guard lock(mutex_);
    return source_late_ns_;
}

bool RealtimeCamera::is_ahead() noexcept {
    const std::lock_guard lock(mutex_);
    if (ready_count() == 0) return false;
    const Slot& newest = ready(ready_count() - 1);
    return newest.status != Status::kOk || !is_due(newest) || (!has_epoch_ && taken_ == kSlots);
}

}  // namespace stillmesh
