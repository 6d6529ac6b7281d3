// What is known before a frame is looked at.
#pragma once

#include <cstdint>

#include "engine/geometry/se3.hpp"

namespace stillmesh {

struct RegionContext {
    SE3 world_from_camera_predicted;
    double prediction_sigma_m = 0.05;
    double prediction_sigma_rad = 0.05;
    double rotation_speed_rad_s = 0;
    double colour_depth_lag_s = 0;
    double inlier_ratio = 0.5;  // of the last frame
    double travelled = 0;       // the odometer's
    std::uint32_t image_width_px = 640;
    bool has_prediction = false;
};

}  // namespace stillmesh
