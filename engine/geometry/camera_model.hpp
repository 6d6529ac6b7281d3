// The pinhole camera and its lens: plain data. Two kinds of lenses, with coefficients as OpenCV, ROS, Kalibr and TUM
// write them: Brown's radial-tangential one (1966), with k4 to k6 "rational", and the fisheye of Kannala and Brandt
// (2006).
#pragma once

#include <cstdint>
#include <initializer_list>

namespace stillmesh {

// r and (x, y): normalised, undistorted; theta = atan(r).
enum class Lens : std::uint8_t {
    kBrown,    // (x, y) (1 + k1 r^2 + k2 r^4 + k3 r^6) / (1 + k4 r^2 + k5 r^4 + k6 r^6), and tangential p1, p2
    kFisheye,  // (x, y) theta (1 + k1 theta^2 + k2 theta^4 + k3 theta^6 + k4 theta^8) / r; the others are 0
};

// Frame: x right, y down, z forward; pixel (0, 0) is the centre of the top left pixel.
struct CameraModel {
    std::uint32_t width = 0;                        // px
    std::uint32_t height = 0;                       // px
    double fx = 0, fy = 0;                          // focal lengths, px
    double cx = 0, cy = 0;                          // principal point, px
    double k1 = 0, k2 = 0, p1 = 0, p2 = 0, k3 = 0;  // distortion, dimensionless
    double k4 = 0, k5 = 0, k6 = 0;
    Lens lens = Lens::kBrown;

    [[nodiscard]] bool operator==(const CameraModel&) const = default;
    // What older files of maps and recordings have no place for.
    [[nodiscard]] constexpr bool is_plain_brown() const noexcept {
        return lens == Lens::kBrown && k4 == 0 && k5 == 0 && k6 == 0;
    }
    // The same camera, and of cameras that are equal the same bits: a zero below zero becomes a plain one, since files
    // keep bits and compare numbers.
    [[nodiscard]] constexpr CameraModel with_plain_zeros() const noexcept {
        CameraModel out = *this;
        for (double* number : {&out.fx, &out.fy, &out.cx, &out.cy, &out.k1, &out.k2, &out.p1, &out.p2, &out.k3, &out.k4,
                               &out.k5, &out.k6})
            *number += 0.0;
        return out;
    }
};

}  // namespace stillmesh
