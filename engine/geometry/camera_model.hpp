// The pinhole camera with radial-tangential distortion (Brown 1966, as OpenCV, ROS and TUM write it): plain data.
#pragma once

#include <cstdint>

namespace stillmesh {

// Frame: x right, y down, z forward; pixel (0, 0) is the centre of the top left pixel.
struct CameraModel {
    std::uint32_t width = 0;                        // px
    std::uint32_t height = 0;                       // px
    double fx = 0, fy = 0;                          // focal lengths, px
    double cx = 0, cy = 0;                          // principal point, px
    double k1 = 0, k2 = 0, p1 = 0, p2 = 0, k3 = 0;  // distortion, dimensionless
};

}  // namespace stillmesh
