// The port to a depth camera. A camera is opened, polled for its newest frame, and closed; whoever implements it keeps
// the pixels alive until the next poll. Pure data comes out: no camera library's type crosses this header.
// Bodies fail a CHECK instead of being pure: see docs/decisions.md (ports without __cxa_pure_virtual).
#pragma once

#include <cstdint>
#include <optional>

#include "engine/base/check.hpp"
#include "engine/base/status.hpp"
#include "engine/frame/frame.hpp"
#include "engine/geometry/camera_model.hpp"
#include "engine/geometry/rigid_transform.hpp"

namespace stillmesh {

// A depth camera beside the colour camera: another lens at another place, whose images nobody has registered yet.
struct SeparateDepth {
    CameraModel model;
    RigidTransform colour_from_depth;  // takes points of the depth camera's frame (m) into the colour camera's
};

// What a camera knows about itself once it is open.
struct CameraInfo {
    CameraModel model;  // intrinsics and distortion of the colour image, size in px
    double depth_units_per_m = 5000.0;
    double frames_per_s = 30.0;
    double readout_s = -1;  // of a rolling shutter, from the first row to the last; 0: none; negative: unknown
    std::optional<SeparateDepth> separate_depth = std::nullopt;  // none: depth is as the colour camera would see it
    bool is_depth_older = false;  // by half a period or more in every frame: worth being moved to its picture
};

class DepthCamera {
public:
    // kOk: frames can be polled.        kUnavailable: no device or file; may be tried again.
    // kInvalid: opened, but its mode or calibration cannot be used.
    [[nodiscard]] virtual Status open() noexcept { return not_implemented(); }
    // Valid after open() returned kOk.
    [[nodiscard]] virtual const CameraInfo& info() const noexcept {
        check_failed("DepthCamera::info not implemented", __FILE__, __LINE__);
    }
    // Fills `frame` with the newest complete frame, without waiting. Its pixels stay valid until the next poll or
    // close.
    //   kOk        newer than the last one       kUnavailable  device gone; open() may be tried again
    //   kTimedOut  nothing new yet               kCorrupt      wrong size or bytes; `frame` is untouched, poll may go
    //   on kEnd       the recording is over
    [[nodiscard]] virtual Status poll(Frame& frame) noexcept {
        static_cast<void>(frame);
        return not_implemented();
    }
    // Returns when a frame may be there, or after timeout_ms (kTimedOut), never later; kUnavailable: the device is
    // gone.
    [[nodiscard]] virtual Status wait(std::uint32_t timeout_ms) noexcept {
        static_cast<void>(timeout_ms);
        return not_implemented();
    }
    virtual void close() noexcept {}

protected:
    ~DepthCamera() = default;

private:
    [[noreturn]] static Status not_implemented() noexcept {
        check_failed("DepthCamera not implemented", __FILE__, __LINE__);
    }
};

}  // namespace stillmesh
