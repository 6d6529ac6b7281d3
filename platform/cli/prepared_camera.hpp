// What stands between a camera and the engine: depth that is older than its picture is moved to it, then a mask of
// what is not looked at (--mask), then half the size (--half).
#pragma once

#include <memory>
#include <string>

#include "engine/outputs.hpp"
#include "hal/live/half_camera.hpp"
#include "hal/live/masked_camera.hpp"
#include "hal/live/moved_depth_camera.hpp"

namespace stillmesh {

// Whether --mask names what a recording has for each picture, or says that it has none, rather than one image for all.
[[nodiscard]] bool is_mask_of_frames(const std::string& mask);

class PreparedCamera {
public:
    explicit PreparedCamera(DepthCamera& source) : camera_(&source) {}

    // The source is open. `mask`: an image of its size, grey or colour, white where nothing is to be looked at; empty:
    // none, and so is what is_mask_of_frames. kInvalid, kUnavailable: `message` says what is wrong with it; `note` is
    // what a user should know of it.
    [[nodiscard]] Status prepare(const std::string& mask, bool is_half, std::string& note, std::string& message);
    [[nodiscard]] DepthCamera& camera() { return *camera_; }
    // What became of the frame that was polled last.
    void learn(const PoseEstimate& pose) noexcept;

private:
    DepthCamera* camera_;
    std::unique_ptr<MovedDepthCamera> moved_;
    std::unique_ptr<MaskedCamera> masked_;
    std::unique_ptr<HalfCamera> half_;
};

}  // namespace stillmesh
