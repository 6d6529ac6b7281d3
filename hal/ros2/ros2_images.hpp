// ROS's images and calibrations as frames need them. Colour: rgb8, bgr8, mono8; depth: 16UC1 (mm) and 32FC1 (m, kept in
// quarters of a millimetre up to 16.38 m). What is not there, or is no number, is no measurement (0). Every size and
// length is checked: a message is what somebody sent. Limits: sides of 4096 px. Errors: a sentence without a name.
#pragma once

#include <cstdint>
#include <span>
#include <string>
#include <string_view>
#include <vector>

#include "engine/base/status.hpp"
#include "engine/frame/frame.hpp"
#include "hal/depth_camera.hpp"

namespace stillmesh {

inline constexpr std::uint32_t kRosImageSideMax = 4096;  // px

struct RosImageView {
    std::uint32_t width = 0, height = 0;  // px
    std::uint32_t step = 0;               // bytes from row to row
    bool is_bigendian = false;
    std::string_view encoding;
    std::span<const std::uint8_t> bytes;
};

// Rows without gaps. False: `problem` says why; `pixels` has lost its content.
[[nodiscard]] bool colour_of(const RosImageView& image, std::vector<std::uint8_t>& pixels, PixelFormat& format,
                             std::string& problem);
[[nodiscard]] bool depth_of(const RosImageView& image, std::vector<std::uint16_t>& pixels, double& units_per_m,
                            std::string& problem);

struct RosLensView {
    std::uint32_t width = 0, height = 0;
    std::string_view model;
    std::span<const double> d;
    std::span<const double, 9> k;
    bool is_cut = false;  // binning, or a region of interest
};
// sensor_msgs/CameraInfo as a camera file of ROS with the same numbers would be read. kInvalid: `problem`.
[[nodiscard]] Status lens_of(const RosLensView& lens, CameraInfo& info, std::string& problem);

}  // namespace stillmesh
