// What a RealSense D4xx camera says about itself, as bytes: commands and answers of its extension unit, and the tables
// of its calibration. Layouts and numbers are facts from the sources of librealsense (github.com/IntelRealSense,
// Apache 2.0: src/ds/d400/d400-private.h and .cpp, src/ds/ds-private.h, src/hw-monitor.cpp); no code of it is here. Any
// bytes are safe: what is too short, has another checksum or holds numbers that no camera has is refused with a
// sentence. Little-endian hosts and others.
#pragma once

#include <array>
#include <cstdint>
#include <span>
#include <string>

#include "engine/base/status.hpp"
#include "engine/geometry/camera_model.hpp"
#include "engine/geometry/rigid_transform.hpp"

namespace stillmesh::v4l2 {

inline constexpr std::uint16_t kRealSenseVendor = 0x8086;
inline constexpr std::uint16_t kD405 = 0x0b5b, kD415 = 0x0ad3, kD435 = 0x0b07, kD435i = 0x0b3a, kD455 = 0x0b5c;
// "RealSense D435"; nullptr: none of these.
[[nodiscard]] const char* realsense_name(std::uint16_t vendor_id, std::uint16_t product_id) noexcept;

// The extension unit (GUID C9606CCB-594C-4D25-AF47-CCC496435995) and its controls.
inline constexpr std::uint8_t kRealSenseUnit = 3;
inline constexpr std::uint8_t kCommandControl = 1;
inline constexpr std::uint8_t kEmitterControl = 2;  // a byte: 0 off, 1 on
inline constexpr std::size_t kMessageBytes = 1024;
using Message = std::array<std::uint8_t, kMessageBytes>;

enum class Command : std::uint32_t {
    kDetails = 0x10,      // serial number, firmware
    kCalibration = 0x15,  // parameter: which table
    kAdvanced = 0x2c,     // parameter: which group of settings
    kAlternate = 0x77,    // parameter: 1: the projector is on for every other image; only while nothing streams
};
inline constexpr std::uint32_t kDepthTable = 25;   // of kCalibration
inline constexpr std::uint32_t kColourTable = 32;  // of kCalibration
inline constexpr std::uint32_t kDepthUnits = 9;    // of kAdvanced

[[nodiscard]] Message command_message(Command command, std::uint32_t parameter) noexcept;
// What an answer carries behind the echo of the command; where the device does not say how long that is, all of it.
//   kOk    kCorrupt: an answer to something else, or an error of the camera: `message` says which
[[nodiscard]] Status answer_body(Command command, std::span<const std::uint8_t, kMessageBytes> answer,
                                 std::span<const std::uint8_t>& body, std::string& message);

struct DeviceDetails {
    std::string serial;    // as on the camera's label
    std::string firmware;  // "5.16.0.1"
};
// All of these:    kOk    kCorrupt: `message` says why, and nothing else is touched
[[nodiscard]] Status parse_details(std::span<const std::uint8_t> body, DeviceDetails& details, std::string& message);
// Depth units per metre.
[[nodiscard]] Status parse_depth_units(std::span<const std::uint8_t> body, double& depth_units_per_m,
                                       std::string& message);
// Of rectified depth images of that size: no distortion. In: `model`'s width and height.
[[nodiscard]] Status parse_depth_table(std::span<const std::uint8_t> table, CameraModel& model, std::string& message);
// Of colour images of that size, and where the colour camera stands. In: `model`'s width and height.
[[nodiscard]] Status parse_colour_table(std::span<const std::uint8_t> table, std::uint16_t product_id,
                                        CameraModel& model, RigidTransform& colour_from_depth, std::string& message);

// The data sheet's camera of a kind, for those whose tables cannot be read: depth's focal length from its field of view
// (D400 series data sheet: 87 degrees; D415 65; D405 84), the colour camera's place as such cameras report it. In:
// `model`'s width and height.
void nominal_depth(std::uint16_t product_id, CameraModel& model, RigidTransform& colour_from_depth) noexcept;

}  // namespace stillmesh::v4l2
