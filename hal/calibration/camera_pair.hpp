// Camera files that name two cameras, colour and depth, and how they stand to each other: our own (a table [depth] with
// the lens, tx ty tz in m and qx qy qz qw: what takes points of the depth camera into the colour camera), Kalibr's
// chains (T_cn_cnm1, T_cam_imu; the depth camera is the one whose topic is of depth, or else of the first infrared
// camera), and RealSense's numbers as librealsense gives them (color, depth, depth_to_color with the rotation column by
// column and the translation in m). Of files of others the depth camera counts only if its images have another size
// than colour's: of one size they are taken for registered.
#pragma once

#include <string>
#include <vector>

#include "hal/calibration/camera_keys.hpp"

namespace stillmesh {

// Reads the colour camera, and the depth camera beside it if the file has one whose place is said.
//   kInvalid: `message` names file, line, key and remedy
[[nodiscard]] Status cameras_of_entries(const std::vector<CameraEntry>& entries, bool is_own, const std::string& file,
                                        CameraInfo& info, std::string& message);

}  // namespace stillmesh
