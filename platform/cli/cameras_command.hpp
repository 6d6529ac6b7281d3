// `stillmesh cameras`: which depth cameras are plugged in, whether each can stream, and if not, the one thing to do.
// Also the udev rules to install, and the reset of a camera that is stuck. Needs libusb (STILLMESH_WITH_USB).
#pragma once

#include <string>
#include <vector>

#include "hal/usb/camera_check.hpp"

namespace stillmesh {

struct CamerasOptions {
    bool is_json = false;
    bool is_udev_rules = false;
    bool is_reset = false;
    std::string reset_port;  // empty: the only camera
};

// Exit codes: 0 a camera can stream (or was reset); 1 none can; 2 the bus cannot be read.
int cameras_command(const CamerasOptions& options);

// What is installed on this system, as far as the check wants to know.
[[nodiscard]] CameraSurroundings camera_surroundings();
// The reports as people and as machines read them.
[[nodiscard]] std::string cameras_text(const std::vector<CameraReport>& reports);
[[nodiscard]] std::string cameras_json(const std::vector<CameraReport>& reports);

}  // namespace stillmesh
