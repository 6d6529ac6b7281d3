// Frames with their truth, whatever they come from: the simulated camera, its cached pictures, or a recording.
#pragma once

#include <memory>
#include <string>

#include "bench/accuracy/runs.hpp"
#include "hal/depth_camera.hpp"

namespace stillmesh::accuracy {

struct TrueFrame {
    Frame frame;
    bool has_truth = false;
    TrajectoryPose truth;
    // 255: a moving body, 0: none; between: a blurred border, not judged. No pixels: unknown.
    ImageView<std::uint8_t> mask;
};

class Source {
public:
    virtual ~Source() = default;
    [[nodiscard]] virtual const CameraModel& model() const = 0;
    [[nodiscard]] virtual double readout_s() const { return -1; }  // as in CameraInfo
    // Frames of the whole run.
    [[nodiscard]] virtual std::uint32_t frame_count() const = 0;
    // kOk, kEnd; else `message` says what is wrong. Valid until the next call.
    [[nodiscard]] virtual Status next(TrueFrame& frame, std::string& message) = 0;
};

// Null: `message` says why.
[[nodiscard]] std::unique_ptr<Source> open_source(const Input& input, const RunOptions& options, std::string& message);

}  // namespace stillmesh::accuracy
