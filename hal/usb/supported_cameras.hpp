// The depth cameras Stillmesh knows, by the ids they show on the USB bus: what they are, which driver serves them, and
// those that look like one and cannot be used. The udev rules that let a user open them are made from the same table.
#pragma once

#include <cstdint>
#include <span>
#include <string>
#include <string_view>

namespace stillmesh {

enum class CameraDriver : std::uint8_t {
    kNone,
    kPs1080,    // OpenNI2's libPS1080
    kPsLink,    // OpenNI2's libPSLink
    kOrbbec,    // OpenNI2's liborbbec, from Orbbec's SDK: Debian does not have it
    kFreenect,  // libfreenect
    kV4l2,      // the kernel's uvcvideo, through its video nodes
};
// "OpenNI2 (libPS1080)"
[[nodiscard]] const char* driver_name(CameraDriver driver) noexcept;
// The plug-in's file name without ending; empty: not a plug-in of OpenNI2.
[[nodiscard]] std::string_view openni2_plug_in(CameraDriver driver) noexcept;

enum class CameraRole : std::uint8_t {
    kCamera,       // colour and depth
    kDepthOnly,    // no colour, or colour that the driver does not serve
    kBootloader,   // a camera that waits for its firmware
    kKinectMotor,  // shows itself before the Kinect's camera does; the camera needs the power brick
    kKinectPart,   // microphones: of no interest, but libfreenect may want to open them
    kUnsupported,  // known, and nothing here serves it
};

struct SupportedCamera {
    std::uint16_t vendor_id;
    std::uint16_t product_id;
    CameraRole role;
    CameraDriver driver;
    const char* name;
    const char* remark;  // for kDepthOnly and kUnsupported: why, as the end of a sentence
};

[[nodiscard]] std::span<const SupportedCamera> supported_cameras() noexcept;
// nullptr: none of ours.
[[nodiscard]] const SupportedCamera* find_supported_camera(std::uint16_t vendor_id, std::uint16_t product_id) noexcept;

// What one camera moves over the bus with colour and depth at 640x480, 30 frames/s, and what a USB 2 bus carries in
// practice, MB/s. PrimeSense cameras: colour 2 bytes and depth 11 bits per pixel. The Kinect reserves 1920 bytes for
// each of its two streams in each of the bus's 8000 periods a second.
inline constexpr std::uint32_t kCameraMegabytesPerS = 31;
inline constexpr std::uint32_t kUsb2MegabytesPerS = 40;

// Where the rules belong on a user's machine.
inline constexpr const char* kUdevRulesFile = "/etc/udev/rules.d/60-stillmesh.rules";
inline constexpr const char* kUdevGroup = "video";
// The text of 60-stillmesh.rules.
[[nodiscard]] std::string udev_rules();

}  // namespace stillmesh
