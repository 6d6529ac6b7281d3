// A RealSense D4xx that is plugged in, asked through the extension unit of its depth node: serial number, firmware,
// depth unit, calibration; and told whether its projector takes turns with the images. Cost: a message of 1 kB to and
// fro for each; a camera that does not answer takes uvcvideo's own 5 s, once.
#pragma once

#include <string>

#include "engine/base/status.hpp"
#include "hal/v4l2/realsense_tables.hpp"
#include "hal/v4l2/v4l2_link.hpp"

namespace stillmesh::v4l2 {

struct RealSenseCalibration {
    CameraModel depth, colour;  // in: width and height of the images
    RigidTransform colour_from_depth;
};

class RealSenseDevice {
public:
    RealSenseDevice(V4l2Link& link, int handle) noexcept : link_(link), handle_(handle) {}

    // All of them:    kOk    kUnavailable: unplugged    kCorrupt: refused, or an answer that cannot be right, twice;
    // `message` is the middle of a sentence
    [[nodiscard]] Status read_details(DeviceDetails& details, std::string& message);
    [[nodiscard]] Status read_depth_units(double& depth_units_per_m, std::string& message);
    [[nodiscard]] Status set_alternating(bool is_on, std::string& message);
    [[nodiscard]] Status read_depth(CameraModel& depth, std::string& message);
    [[nodiscard]] Status read_colour(std::uint16_t product_id, RealSenseCalibration& calibration, std::string& message);

private:
    // Asks, and again if `take` cannot use the answer: on the way it may have been damaged.
    template <typename Take>
    [[nodiscard]] Status ask(Command command, std::uint32_t parameter, std::string& message, Take&& take);
    [[nodiscard]] Status ask_once(Command command, std::uint32_t parameter, Message& answer,
                                  std::span<const std::uint8_t>& body, std::string& message);

    V4l2Link& link_;
    int handle_;
};

}  // namespace stillmesh::v4l2
