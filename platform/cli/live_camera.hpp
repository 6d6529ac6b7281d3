// A camera that is plugged in, or a file of one, behind one face: what `--camera` names, whichever library drives it.
#pragma once

#include <functional>
#include <memory>
#include <string>
#include <vector>

#include "hal/depth_camera.hpp"
#include "hal/live/frame_times.hpp"
#include "platform/report/run_record.hpp"

namespace stillmesh {

struct LiveCameraOptions {
    // auto, openni2[:URI|:SERIAL|:FILE.oni], freenect[:NUMBER], v4l2[:SERIAL|:ir|:DEPTH,COLOUR],
    // ros2[:COLOUR,DEPTH,INFO]
    std::string camera;
    std::string calibration;            // file or name; empty: the camera's own
    std::string exposure = "auto";      // auto, fixed
    std::string registration = "auto";  // auto, here, none
    std::string record;                 // .oni file to write; empty: none
    std::uint32_t width_max = 640;      // px
    std::uint32_t height_max = 480;     // px
    bool is_realtime = false;           // its threads go before ordinary ones, where that is granted
};

class LiveCamera {
public:
    virtual ~LiveCamera() = default;
    [[nodiscard]] virtual DepthCamera& camera() = 0;
    [[nodiscard]] virtual FrameTimes& times() = 0;
    // Why the last call failed.
    [[nodiscard]] virtual std::string message() const = 0;
    // What is known of a silence, such as which stream it is; empty: nothing.
    [[nodiscard]] virtual std::string silence() const { return {}; }
    // A recording: every frame in order, as fast as it is asked for.
    [[nodiscard]] virtual bool is_file() const = 0;
    // Once it is open:
    [[nodiscard]] virtual std::string device() const = 0;
    [[nodiscard]] virtual std::string calibration_source() const = 0;
    [[nodiscard]] virtual std::vector<std::string> notes() const = 0;
    [[nodiscard]] virtual std::uint64_t frames_expected() const = 0;  // 0: unknown
    // What it counted.
    virtual void account(CameraRecord& record) const = 0;
    // Brings a stalled device back to its senses; false: nothing can be done here.
    [[nodiscard]] virtual bool reset() { return false; }
};

// null: the name is not understood, or what it needs is not in this build; `message` says what to do.
[[nodiscard]] std::unique_ptr<LiveCamera> make_live_camera(const LiveCameraOptions& options, std::string& message);

// Opens it; with `does_wait` until there is one, or a stop signal. kUnavailable, kInvalid: `message` says why.
[[nodiscard]] Status open_live_camera(DepthCamera& camera, const std::function<std::string()>& camera_message,
                                      bool does_wait, std::string& message);

}  // namespace stillmesh
