// A depth camera in a rendered office: the same scene name and seed give the same bytes on every processor. Beside the
// frames it knows the truth: where the camera is and which pixels belong to moving bodies. Colour is 8-bit grey, a mean
// over the exposure (motion blur) with drifting exposure and noise; depth is what a Kinect would say
// (depth_sensor.hpp). Cost: below 60 ms per 640x480 frame, some 25 MB of textures and buffers, taken in open().
#pragma once

#include <array>
#include <cstdint>
#include <memory>
#include <optional>
#include <span>
#include <string>
#include <vector>

#include "hal/depth_camera.hpp"
#include "hal/simulated/dirt.hpp"

namespace stillmesh {

struct SimulationOptions {
    std::string scene;                      // a name of simulated_scenes()
    std::uint64_t seed = 1;                 // textures, furniture, ways of people, phase of the camera
    std::uint64_t day = 0;                  // not 0: the seed's room on another day: people, the camera's way and the
                                            // light are those of this number instead
    std::uint32_t frames = 0;               // 0: the scene's own length
    std::uint32_t width = 640;              // px, 32..2047
    std::uint32_t height = 480;             // px, 32..2047
    std::int64_t depth_lag_ns = 0;          // depth is taken this much later than colour; within +-33 ms
    std::int64_t exposure_ns = 12'000'000;  // 0: no motion blur
    double depth_baseline_m = 0;  // the depth camera stands so far to the left, its depth is not registered; below 1
    Dirt dirt = {};               // what is not said, the scene says
    // Depth of a camera of its own, without distortion, which sees all its rows at once: not registered, and without
    // what dirt does to depth.
    std::optional<SeparateDepth> separate_depth = std::nullopt;
};

struct SimulatedScene {
    const char* name = nullptr;
    std::uint32_t frames = 0;  // its own length, at 30 frames a second
    Dirt dirt = {};            // its own; nothing in most
};

// Where the camera truly is: world_from_camera.
struct SimulatedPose {
    std::int64_t time_ns = 0;
    std::array<double, 3> t{};                    // m
    std::array<double, 4> q{0.0, 0.0, 0.0, 1.0};  // x y z w, of length 1, w >= 0
};

[[nodiscard]] std::span<const SimulatedScene> simulated_scenes() noexcept;

class SimulatedCamera final : public DepthCamera {
public:
    explicit SimulatedCamera(SimulationOptions options);
    ~SimulatedCamera();
    SimulatedCamera(const SimulatedCamera&) = delete;
    SimulatedCamera& operator=(const SimulatedCamera&) = delete;

    // kOk; kInvalid: no such scene, or an option out of its range: message() says which.
    [[nodiscard]] Status open() noexcept override;
    [[nodiscard]] const CameraInfo& info() const noexcept override;
    // kOk, kEnd; kUnavailable: not open.
    [[nodiscard]] Status poll(Frame& frame) noexcept override;
    // A simulation never lets anyone wait: kOk, or kEnd after the last frame.
    [[nodiscard]] Status wait(std::uint32_t timeout_ms) noexcept override;
    void close() noexcept override;
    // The next poll gives this frame (0 for the first), the same as if all before it had been polled.
    void seek(std::uint32_t frame) noexcept { next_ = frame; }

    [[nodiscard]] const std::string& message() const noexcept { return message_; }
    // Frames of the whole run. Valid after open().
    [[nodiscard]] std::uint32_t frame_count() const noexcept { return frame_count_; }
    // Of the last polled frame, at the time of its colour image: with a rolling shutter, that of its middle row.
    [[nodiscard]] const SimulatedPose& true_pose() const noexcept { return pose_; }
    // 255 = a moving body. Valid as long as the frame.
    [[nodiscard]] ImageView<std::uint8_t> dynamic_mask() const noexcept;
    // Share of moving bodies' pixels in the last frame, 0..1.
    [[nodiscard]] double dynamic_share() const noexcept { return dynamic_share_; }

private:
    struct State;

    void choose_frames(double gaps);

    SimulationOptions options_;
    CameraInfo info_;
    std::string message_;
    std::uint64_t day_ = 0;  // seed of all but the room
    std::uint32_t frame_count_ = 0;
    std::uint32_t next_ = 0;
    std::vector<std::uint32_t> taken_;  // numbers of the frames that are not missing
    SimulatedPose pose_;
    double dynamic_share_ = 0;
    std::unique_ptr<State> state_;
};

}  // namespace stillmesh
