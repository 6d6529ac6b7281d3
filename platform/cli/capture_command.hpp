// `stillmesh capture`: a live camera into a recording, in the TUM layout (PNG files and lists, ready for `run
// --replay`) or as an .oni file. In the TUM layout a frame for which the disk or the processor has no time is left out
// and counted; an .oni file is written by OpenNI2, which leaves none out and needs some 50 MB/s at 640x480.
#pragma once

#include <cstdint>
#include <string>

#include "platform/cli/live_camera.hpp"

namespace stillmesh {

struct CaptureArguments {
    LiveCameraOptions camera;
    std::string out;           // folder to make, or FILE.oni
    std::uint64_t frames = 0;  // 0: until Ctrl-C
    bool does_wait = false;    // for a camera
    bool is_json = false;
};

// The program's exit code: 0; 1 the camera went away or the disk is full; 2 no camera, or the place cannot be used;
// 128 + signal. Whatever was written is whole.
[[nodiscard]] int capture_command(const CaptureArguments& arguments);

}  // namespace stillmesh
