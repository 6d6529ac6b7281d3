// What the keys of camera files mean: our own, ROS camera_info, OpenCV, ORB-SLAM 2 and 3, stella_vslam, Kalibr, EuRoC,
// OpenLORIS, Open3D and RealSense call the same numbers by other names. Sources: each project's public documentation
// and example files. What changes the lens is never guessed: it is read, or refused by name.
#pragma once

#include <span>
#include <string>

#include "hal/calibration/camera_entries.hpp"
#include "hal/depth_camera.hpp"

namespace stillmesh {

// `is_own`: our own format, in which every key must be known. Else keys that speak of other things are passed over, but
// for those that look like a misspelt one of what is missing. Of several cameras the colour camera is read. Width and
// height are 0 when the file does not give them, depth_units_per_m when it has none.
//   kInvalid: `message` names file, line, key and remedy
[[nodiscard]] Status camera_of_entries(std::span<const CameraEntry> entries, bool is_own, const std::string& file,
                                       CameraInfo& info, std::string& message);

}  // namespace stillmesh
