// What the keys of camera files mean: our own, ROS camera_info, OpenCV, ORB-SLAM 2 and 3, stella_vslam, Kalibr, EuRoC,
// OpenLORIS, Open3D and RealSense call the same numbers by other names. Sources: each project's public documentation
// and example files. What changes the lens is never guessed: it is read, or refused by name.
#pragma once

#include <span>
#include <string>

#include "hal/calibration/camera_entries.hpp"
#include "hal/depth_camera.hpp"

namespace stillmesh {

struct CameraFile {
    std::span<const CameraEntry> entries;
    bool is_own;              // our own format, in which every key must be known
    const std::string& file;  // for messages
};

// In files of others, keys that speak of other things are passed over, but for those that look like a misspelt one of
// what is missing. `prefix`: which camera of the file, such as "depth."; with "*" the colour camera, and `prefix` says
// how its keys begin. Width and height are 0 when the file does not give them, depth_units_per_m when it has none.
//   kInvalid: `message` names file, line, key and remedy
[[nodiscard]] Status camera_of_entries(const CameraFile& file, std::string& prefix, CameraInfo& info,
                                       std::string& message);

}  // namespace stillmesh
