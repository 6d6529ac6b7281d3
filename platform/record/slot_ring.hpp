// A fixed number of slots between the thread that makes things and one thread that writes them to a disk or a network.
// The maker never waits: when every slot is taken it is told so. Slots are made once and reused; nothing is allocated
// afterwards.
#pragma once

#include <chrono>
#include <condition_variable>
#include <cstddef>
#include <mutex>
#include <vector>

namespace stillmesh {

template <typename Slot>
class SlotRing {
public:
    explicit SlotRing(std::size_t count) : slots_(count) {}

    // Before either thread begins.
    [[nodiscard]] std::vector<Slot>& slots() { return slots_; }

    // --- the maker ---
    // The slot to fill, then to publish; nullptr: all are taken.
    [[nodiscard]] Slot* claim() {
        const std::lock_guard lock(mutex_);
        return taken_ == slots_.size() ? nullptr : &slots_[(first_ + taken_) % slots_.size()];
    }
    void publish() {
        const std::lock_guard lock(mutex_);
        ++taken_;
        changed_.notify_all();
    }
    // For a maker that has time: true when a slot is free.
    bool wait_for_room(std::chrono::milliseconds timeout) {
        std::unique_lock lock(mutex_);
        return changed_.wait_for(lock, timeout, [this] { return taken_ < slots_.size(); });
    }
    // No more will be published: the writer ends once it has written the rest.
    void close() {
        const std::lock_guard lock(mutex_);
        is_closed_ = true;
        changed_.notify_all();
    }

    // --- the writer ---
    // The oldest published slot, which stays taken until release(); nullptr: closed, and everything was written.
    [[nodiscard]] Slot* wait() {
        std::unique_lock lock(mutex_);
        changed_.wait(lock, [this] { return taken_ > 0 || is_closed_; });
        return taken_ > 0 ? &slots_[first_] : nullptr;
    }
    // As wait(), but no longer than that: nullptr also when the time is over.
    [[nodiscard]] Slot* wait_until(std::chrono::steady_clock::time_point end) {
        std::unique_lock lock(mutex_);
        changed_.wait_until(lock, end, [this] { return taken_ > 0 || is_closed_; });
        return taken_ > 0 ? &slots_[first_] : nullptr;
    }
    // No more will be published, and everything was written.
    [[nodiscard]] bool is_done() {
        const std::lock_guard lock(mutex_);
        return taken_ == 0 && is_closed_;
    }
    void release() {
        const std::lock_guard lock(mutex_);
        first_ = (first_ + 1) % slots_.size();
        --taken_;
        changed_.notify_all();
    }

private:
    std::vector<Slot> slots_;
    std::mutex mutex_;  // held for a few instructions only, never while anything is written
    std::condition_variable changed_;
    std::size_t first_ = 0;
    std::size_t taken_ = 0;
    bool is_closed_ = false;
};

}  // namespace stillmesh
