// The camera check in a run: made with the first frame, fed with each, its findings told and kept. While one holds, no
// pose is given out as tracked.
#pragma once

#include <optional>
#include <string>

#include "hal/depth_camera.hpp"
#include "platform/camera_check/camera_check.hpp"
#include "platform/cli/frame_diagnosis.hpp"
#include "platform/cli/session.hpp"

namespace stillmesh {

class CameraWatch {
public:
    explicit CameraWatch(bool is_on) : is_on_(is_on) {}

    // By what was found until the frame before: the check runs when the pose is out.
    void judge(SessionFrame& out) const {
        if (check_ && check_->holds() && out.state == PoseState::kTracked) out.state = PoseState::kUnsure;
    }
    void frame(const DepthCamera& camera, const Frame& frame, const TrackingSession& session);
    // kCamera while a fault holds.
    [[nodiscard]] FrameFault fault() const {
        return check_ && check_->holds() ? FrameFault::kCamera : FrameFault::kNone;
    }
    // What the user should hear of now, once each; empty: nothing.
    [[nodiscard]] std::string news();
    // Faults become problems of the run.
    void account(RunRecord& record) const;

private:
    bool is_on_;
    std::optional<CameraCheck> check_;
};

}  // namespace stillmesh
