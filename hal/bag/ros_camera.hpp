// The camera of a CameraInfo message, by the same rules as a camera file of ROS (hal/calibration), and whether depth is
// of the same view as colour.
#pragma once

#include <string>

#include "engine/base/status.hpp"
#include "hal/bag/ros_messages.hpp"
#include "hal/depth_camera.hpp"

namespace stillmesh {

// `is_rectified`: of images without the lens's distortion, whose camera is P and not K. kInvalid: binning, a part of
// the picture, or what camera files are refused for; `message` names topic and field.
[[nodiscard]] Status camera_of_message(const CameraInfoMessage& from, const std::string& topic, bool is_rectified,
                                       CameraInfo& info, std::string& message);

// Whether two cameras see the same picture, in larger or smaller pixels.
[[nodiscard]] bool is_same_view(const CameraInfoMessage& one, const CameraInfoMessage& other);

}  // namespace stillmesh
