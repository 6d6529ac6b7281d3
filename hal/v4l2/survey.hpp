// What the video nodes of the RealSense cameras that are plugged in say, for `stillmesh cameras`: whether they can be
// opened, whether somebody streams from them, which modes they offer. Whoever streams is not disturbed. Cost: six nodes
// opened per camera.
#pragma once

#include <vector>

#include "hal/usb/camera_check.hpp"
#include "hal/v4l2/v4l2_link.hpp"

namespace stillmesh::v4l2 {

[[nodiscard]] std::vector<VideoNodes> survey(V4l2Link& link);

}  // namespace stillmesh::v4l2
