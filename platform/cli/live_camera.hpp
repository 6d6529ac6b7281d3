// The camera that `--camera` names: made, opened, reset, and what it counted on record.
#pragma once

#include <functional>
#include <memory>
#include <string>

#include "hal/live/live_camera.hpp"
#include "platform/report/run_record.hpp"

namespace stillmesh {

struct LiveCameraOptions {
    // auto, openni2[:URI|:SERIAL|:FILE.oni], freenect[:NUMBER], v4l2[:SERIAL|:ir|:alternate|:DEPTH,COLOUR],
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

// null: the name is not understood, or what it needs is not in this build; `message` says what to do.
[[nodiscard]] std::unique_ptr<LiveCamera> make_live_camera(const LiveCameraOptions& options, std::string& message);

// Brings a stalled device back to its senses, as pulling its plug would; false: nothing can be done here.
[[nodiscard]] bool reset_live_camera(const LiveCamera& camera);

// What it counted.
void account_live_camera(const LiveCounts& counts, CameraRecord& record);

// Opens it; with `does_wait` until there is one, or a stop signal. kUnavailable, kInvalid: `message` says why.
[[nodiscard]] Status open_live_camera(DepthCamera& camera, const std::function<std::string()>& camera_message,
                                      bool does_wait, std::string& message);

}  // namespace stillmesh
