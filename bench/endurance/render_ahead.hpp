// Frames of a simulated scene, rendered ahead by some threads into a bounded queue, in order, whatever the number of
// threads: the engine under test has one thread for itself and does not wait for pictures. Each thread has a world of
// its own (some 25 MB) and renders any frame.
#pragma once

#include <condition_variable>
#include <cstdint>
#include <mutex>
#include <string>
#include <thread>
#include <vector>

#include "engine/frame/frame.hpp"
#include "engine/geometry/camera_model.hpp"
#include "hal/simulated/simulated_camera.hpp"

namespace stillmesh::endurance {

struct RenderedFrame {
    Frame frame;  // its pixels are those below
    SimulatedPose truth;
    std::vector<std::uint8_t> colour;
    std::vector<std::uint16_t> depth;
};

class RenderAhead {
public:
    RenderAhead() = default;
    ~RenderAhead();
    RenderAhead(const RenderAhead&) = delete;
    RenderAhead& operator=(const RenderAhead&) = delete;

    // False: `message` says why.
    [[nodiscard]] bool start(const SimulationOptions& options, std::uint32_t threads, std::string& message);
    [[nodiscard]] const CameraModel& model() const { return model_; }
    [[nodiscard]] std::uint32_t frame_count() const { return frame_count_; }
    // The next frame, valid until the next call; null after the last.
    [[nodiscard]] const RenderedFrame* next();

private:
    struct Slot {
        RenderedFrame rendered;
        bool is_ready = false;
    };
    void render(const SimulationOptions& options);

    CameraModel model_;
    std::uint32_t frame_count_ = 0;
    std::vector<Slot> slots_;  // frame i in slot i % size
    std::vector<std::thread> threads_;
    std::mutex mutex_;
    std::condition_variable changed_;
    std::uint32_t claimed_ = 0;   // frames that a thread has taken on
    std::uint32_t returned_ = 0;  // frames that the reader is done with
    std::uint32_t given_ = 0;     // frames that the reader was given
    bool is_stopping_ = false;
};

}  // namespace stillmesh::endurance
