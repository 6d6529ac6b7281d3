// The threads that serve connections: made as they are needed, a fixed number at most, and a queue as long in front of
// them. Where that is full, whoever accepts connections waits, and the kernel turns away what is more: cpp-httplib's
// own pool accepts without end, which would take the descriptors that the run needs for its files.
#pragma once

#include <condition_variable>
#include <cstddef>
#include <deque>
#include <functional>
#include <mutex>
#include <thread>
#include <utility>
#include <vector>

namespace stillmesh {

class BoundedTasks {
public:
    explicit BoundedTasks(std::size_t threads_max) : threads_max_(threads_max) { threads_.reserve(threads_max); }
    ~BoundedTasks() { finish(); }
    BoundedTasks(const BoundedTasks&) = delete;
    BoundedTasks& operator=(const BoundedTasks&) = delete;

    // Waits for room.
    void add(std::function<void()> task) {
        std::unique_lock lock(mutex_);
        room_.wait(lock, [this] { return tasks_.size() < threads_max_; });
        tasks_.push_back(std::move(task));
        if (idle_ < tasks_.size() && threads_.size() < threads_max_) threads_.emplace_back([this] { work(); });
        lock.unlock();
        more_.notify_one();
    }
    // All that was added is done, then the threads end.
    void finish() {
        {
            const std::lock_guard lock(mutex_);
            is_over_ = true;
        }
        more_.notify_all();
        for (std::thread& thread : threads_) {
            if (thread.joinable()) thread.join();
        }
    }

private:
    void work() {
        std::unique_lock lock(mutex_);
        for (;;) {
            ++idle_;
            more_.wait(lock, [this] { return !tasks_.empty() || is_over_; });
            --idle_;
            if (tasks_.empty()) return;
            const std::function<void()> task = std::move(tasks_.front());
            tasks_.pop_front();
            lock.unlock();
            room_.notify_one();
            task();
            lock.lock();
        }
    }

    const std::size_t threads_max_;
    std::mutex mutex_;
    std::condition_variable more_, room_;
    std::deque<std::function<void()>> tasks_;
    std::vector<std::thread> threads_;
    std::size_t idle_ = 0;
    bool is_over_ = false;
};

}  // namespace stillmesh
