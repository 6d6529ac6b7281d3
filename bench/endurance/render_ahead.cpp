#include "bench/endurance/render_ahead.hpp"

namespace stillmesh::endurance {

RenderAhead::~RenderAhead() {
    {
        const std::lock_guard lock(mutex_);
        is_stopping_ = true;
    }
    changed_.notify_all();
    for (std::thread& thread : threads_) thread.join();
}

bool RenderAhead::start(const SimulationOptions& options, std::uint32_t threads, std::string& message) {
    SimulatedCamera camera(options);
    if (camera.open() != Status::kOk) {
        message = camera.message();
        return false;
    }
    model_ = camera.info().model;
    frame_count_ = camera.frame_count();
    slots_.resize(3 * threads + 2);
    for (std::uint32_t i = 0; i < threads; ++i) threads_.emplace_back(&RenderAhead::render, this, options);
    return true;
}

void RenderAhead::render(const SimulationOptions& options) {
    SimulatedCamera camera(options);
    if (camera.open() != Status::kOk) return;  // start() opened one like it
    std::unique_lock lock(mutex_);
    for (;;) {
        changed_.wait(lock,
                      [&] { return is_stopping_ || claimed_ == frame_count_ || claimed_ < returned_ + slots_.size(); });
        if (is_stopping_ || claimed_ == frame_count_) return;
        const std::uint32_t index = claimed_++;
        RenderedFrame& out = slots_[index % slots_.size()].rendered;
        lock.unlock();
        camera.seek(index);
        if (camera.poll(out.frame) != Status::kOk) return;
        out.truth = camera.true_pose();
        const std::size_t pixels = std::size_t{out.frame.colour.width} * out.frame.colour.height;
        out.colour.assign(out.frame.colour.data, out.frame.colour.data + pixels);
        out.depth.assign(out.frame.depth.data, out.frame.depth.data + pixels);
        out.frame.colour.data = out.colour.data();
        out.frame.depth.data = out.depth.data();
        lock.lock();
        slots_[index % slots_.size()].is_ready = true;
        changed_.notify_all();
    }
}

const RenderedFrame* RenderAhead::next() {
    std::unique_lock lock(mutex_);
    if (given_ > returned_) {
        slots_[returned_ % slots_.size()].is_ready = false;
        ++returned_;
        changed_.notify_all();
    }
    if (given_ == frame_count_) return nullptr;
    Slot& slot = slots_[given_ % slots_.size()];
    changed_.wait(lock, [&] { return slot.is_ready; });
    ++given_;
    return &slot.rendered;
}

}  // namespace stillmesh::endurance
