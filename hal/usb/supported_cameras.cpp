#include "hal/usb/supported_cameras.hpp"

#include <cstdio>

namespace stillmesh {
namespace {

// Sources:
//   a  the id tables inside Debian 12's libPS1080.so.0 and libPSLink.so.0 (libopenni2-0 2.2.0.33)
//   b  that package's udev rules (60-libopenni2-0.rules)
//   c  usb.ids (linux-usb.org)
//   d  libfreenect 0.5.3: its udev rules and documentation of the Kinect's parts
//   e  Orbbec's udev rules (github.com/orbbec/ros_astra_camera, 56-orbbec-usb.rules)
//   f  the id tables of Orbbec's own OpenNI2 (XnDeviceEnumeration), which name the boot loaders
//   g  libfreenect2's udev rules (90-kinect2.rules)
//   h  librealsense (github.com/IntelRealSense/librealsense, Apache 2.0): src/ds/d400/d400-private.h
constexpr const char* kUvcColour =
    "its colour camera is a webcam of its own (UVC) that OpenNI2 does not serve, so it gives depth alone";
constexpr SupportedCamera kCameras[] = {
    // clang-format off
    {0x1d27, 0x0500, CameraRole::kCamera,      CameraDriver::kPs1080,   "PrimeSense reference camera", ""},        // a
    {0x1d27, 0x0600, CameraRole::kDepthOnly,   CameraDriver::kPs1080,   "ASUS Xtion PRO", "it has no colour camera"},  // a, f
    {0x1d27, 0x0601, CameraRole::kCamera,      CameraDriver::kPs1080,   "ASUS Xtion PRO Live", ""},                // a, c
    {0x1d27, 0x0609, CameraRole::kCamera,      CameraDriver::kPs1080,   "PrimeSense Carmine 1.08 or 1.09", ""},    // a
    {0x1d27, 0x1250, CameraRole::kCamera,      CameraDriver::kPsLink,   "PrimeSense Capri", ""},                   // a
    {0x1d27, 0x1260, CameraRole::kCamera,      CameraDriver::kPsLink,   "PrimeSense Capri", ""},                   // a
    {0x1d27, 0x1270, CameraRole::kCamera,      CameraDriver::kPsLink,   "PrimeSense Capri", ""},                   // a
    {0x1d27, 0x1280, CameraRole::kCamera,      CameraDriver::kPsLink,   "PrimeSense Capri", ""},                   // a, b
    {0x1d27, 0x1290, CameraRole::kCamera,      CameraDriver::kPsLink,   "PrimeSense Capri", ""},                   // a
    {0x1d27, 0xf9db, CameraRole::kCamera,      CameraDriver::kPsLink,   "PrimeSense Capri", ""},                   // a, b
    {0x2bc5, 0x0300, CameraRole::kBootloader,  CameraDriver::kOrbbec,   "Orbbec Astra", ""},                       // f
    {0x2bc5, 0x0301, CameraRole::kBootloader,  CameraDriver::kOrbbec,   "Orbbec Astra", ""},                       // f
    {0x2bc5, 0x0400, CameraRole::kBootloader,  CameraDriver::kOrbbec,   "Orbbec Astra", ""},                       // f
    {0x2bc5, 0x0401, CameraRole::kCamera,      CameraDriver::kOrbbec,   "Orbbec Astra", ""},                       // c, e, f
    {0x2bc5, 0x0402, CameraRole::kCamera,      CameraDriver::kOrbbec,   "Orbbec Astra S", ""},                     // e, f
    {0x2bc5, 0x0403, CameraRole::kDepthOnly,   CameraDriver::kOrbbec,   "Orbbec Astra Pro", kUvcColour},           // c, e, f
    {0x2bc5, 0x0404, CameraRole::kCamera,      CameraDriver::kOrbbec,   "Orbbec Astra Mini", ""},                  // e, f
    {0x2bc5, 0x0407, CameraRole::kCamera,      CameraDriver::kOrbbec,   "Orbbec Astra Mini S", ""},                // c, e, f
    {0x2bc5, 0x060d, CameraRole::kDepthOnly,   CameraDriver::kOrbbec,   "Orbbec Astra Pro Plus", kUvcColour},      // e, f
    {0x045e, 0x02ae, CameraRole::kCamera,      CameraDriver::kFreenect, "Kinect for Xbox 360", ""},                // c, d
    {0x045e, 0x02bf, CameraRole::kCamera,      CameraDriver::kFreenect, "Kinect for Windows", ""},                 // c, d
    {0x045e, 0x02b0, CameraRole::kKinectMotor, CameraDriver::kFreenect, "Kinect for Xbox 360", ""},                // c, d
    {0x045e, 0x02c2, CameraRole::kKinectMotor, CameraDriver::kFreenect, "Kinect for Windows", ""},                 // c, b
    {0x045e, 0x02ad, CameraRole::kKinectPart,  CameraDriver::kFreenect, "Kinect microphones", ""},                 // c, d
    {0x045e, 0x02bb, CameraRole::kKinectPart,  CameraDriver::kFreenect, "Kinect microphones", ""},                 // c
    {0x045e, 0x02be, CameraRole::kKinectPart,  CameraDriver::kFreenect, "Kinect microphones", ""},                 // c, b
    {0x8086, 0x0ad3, CameraRole::kCamera,      CameraDriver::kV4l2,     "Intel RealSense D415", ""},               // c, h
    {0x8086, 0x0b07, CameraRole::kCamera,      CameraDriver::kV4l2,     "Intel RealSense D435", ""},               // c, h
    {0x8086, 0x0b3a, CameraRole::kCamera,      CameraDriver::kV4l2,     "Intel RealSense D435i", ""},              // c, h
    {0x8086, 0x0b5b, CameraRole::kCamera,      CameraDriver::kV4l2,     "Intel RealSense D405", ""},               // h
    {0x8086, 0x0b5c, CameraRole::kCamera,      CameraDriver::kV4l2,     "Intel RealSense D455", ""},               // h
    {0x045e, 0x02c4, CameraRole::kUnsupported, CameraDriver::kNone,     "Kinect for Windows v2", "it speaks another protocol than the first Kinect"},  // g
    {0x045e, 0x02d8, CameraRole::kUnsupported, CameraDriver::kNone,     "Kinect for Xbox One", "it speaks another protocol than the first Kinect"},    // g
    {0x045e, 0x097c, CameraRole::kUnsupported, CameraDriver::kNone,     "Azure Kinect", "its driver is not free software"},                            // c
    // clang-format on
};

}  // namespace

const char* driver_name(CameraDriver driver) noexcept {
    switch (driver) {
        case CameraDriver::kPs1080: return "OpenNI2 (libPS1080)";
        case CameraDriver::kPsLink: return "OpenNI2 (libPSLink)";
        case CameraDriver::kOrbbec: return "OpenNI2 (liborbbec)";
        case CameraDriver::kFreenect: return "libfreenect";
        case CameraDriver::kV4l2: return "V4L2 (the kernel's uvcvideo)";
        case CameraDriver::kNone: break;
    }
    return "none";
}

std::string_view openni2_plug_in(CameraDriver driver) noexcept {
    switch (driver) {
        case CameraDriver::kPs1080: return "libPS1080";
        case CameraDriver::kPsLink: return "libPSLink";
        case CameraDriver::kOrbbec: return "liborbbec";
        case CameraDriver::kFreenect:
        case CameraDriver::kV4l2:
        case CameraDriver::kNone: break;
    }
    return {};
}

std::span<const SupportedCamera> supported_cameras() noexcept {
    return kCameras;
}

const SupportedCamera* find_supported_camera(std::uint16_t vendor_id, std::uint16_t product_id) noexcept {
    for (const SupportedCamera& camera : kCameras) {
        if (camera.vendor_id == vendor_id && camera.product_id == product_id) return &camera;
    }
    return nullptr;
}

std::string udev_rules() {
    // Whoever sits at the machine (uaccess) and members of the group (a service, somebody logged in from afar); not the
    // whole world. uaccess works in files that come before 73-seat-late.rules.
    std::string text =
        "# Lets users open the depth cameras that Stillmesh knows. Made by `stillmesh cameras --udev-rules`.\n"
        "ACTION==\"remove\", GOTO=\"stillmesh_end\"\n"
        "SUBSYSTEM!=\"usb\", GOTO=\"stillmesh_end\"\n"
        "ENV{DEVTYPE}!=\"usb_device\", GOTO=\"stillmesh_end\"\n\n";
    for (const SupportedCamera& camera : kCameras) {
        if (camera.role == CameraRole::kUnsupported) continue;
        char line[200];
        std::snprintf(line, sizeof(line),
                      "# %s%s\nATTR{idVendor}==\"%04x\", ATTR{idProduct}==\"%04x\", MODE=\"0660\", GROUP=\"%s\", "
                      "TAG+=\"uaccess\"\n",
                      camera.name,
                      camera.role == CameraRole::kBootloader    ? ", waiting for its firmware"
                      : camera.role == CameraRole::kKinectMotor ? ", motor"
                                                                : "",
                      camera.vendor_id, camera.product_id, kUdevGroup);
        text += line;
    }
    return text + "\nLABEL=\"stillmesh_end\"\n";
}

}  // namespace stillmesh
