// What keeps each camera on the bus from streaming, and the one thing to do about it. Looks at the bus, at the device's
// file and at who holds it; opens and claims a camera for a moment when nobody else has it, which disturbs nothing.
// Physical reasons come first, then the driver, then permissions: what is said first is to be done first.
// Cost: some milliseconds per camera; one that does not answer takes kAnswerMax_ms.
#pragma once

#include <cstdint>
#include <span>
#include <string>
#include <string_view>
#include <vector>

#include "hal/usb/supported_cameras.hpp"
#include "hal/usb/usb_link.hpp"

namespace stillmesh {

inline constexpr std::uint32_t kAnswerMax_ms = 500;

enum class CameraVerdict : std::uint8_t {
    kReady = 0,
    kSlowBus,        // connected as USB 2: streams its smaller modes
    kSharedBus,      // streams alone, but not together with another camera on the same USB 2 bus
    kUnsupported,    // nothing here serves it
    kBootloader,     // it has not loaded its firmware
    kNoCamera,       // a Kinect's motor without its camera: the power brick is missing
    kNoPower,        // the kernel has left it off
    kTooSlow,        // connected as USB 1
    kDepthOnly,      // no colour image
    kDriverMissing,  // the program or the system lacks the driver
    kNoNode,         // its file is not there: a container
    kDenied,         // this user may not open it
    kHeld,           // another process or a kernel driver has it
    kNoAnswer,       // open, but it does not answer, or has halted
};
[[nodiscard]] const char* verdict_name(CameraVerdict verdict) noexcept;
[[nodiscard]] constexpr bool can_stream(CameraVerdict verdict) noexcept {
    return verdict == CameraVerdict::kReady || verdict == CameraVerdict::kSlowBus ||
           verdict == CameraVerdict::kSharedBus;
}

// What the kernel's video nodes of a camera say that is served through them.
struct VideoNodes {
    std::string usb_port;            // as port_text writes it
    std::vector<std::string> paths;  // /dev/video0, ...
    std::string absent;              // a path that is not there; empty: all are
    std::string denied;              // that this user may not open
    std::string busy;                // that another process streams from
    std::string broken;              // that does not answer as a camera does
    std::string depth_modes;         // "848x480@30 640x480@30"; empty: none
    std::string colour_modes;
};

// What the check cannot see on the bus: what is installed.
struct CameraSurroundings {
    bool has_openni2 = false;                    // in this build
    bool has_freenect = false;                   // in this build
    bool has_v4l2 = false;                       // in this build
    std::vector<VideoNodes> video_nodes;         // of the cameras that V4L2 serves
    std::string plug_in_folder;                  // where OpenNI2 looks for its drivers
    std::vector<std::string> plug_ins;           // file names there, such as libPS1080.so.0
    std::vector<std::string> unusable_plug_ins;  // there too, but damaged or for another processor
    std::vector<std::string> rule_files;         // our udev rules, where they are installed
};

struct CameraReport {
    const SupportedCamera* camera = nullptr;
    UsbDevice device;
    CameraVerdict verdict = CameraVerdict::kReady;
    std::string problem;                // why it cannot stream, one sentence; empty: it can
    std::string advice;                 // the one thing to do, one sentence
    std::vector<std::string> commands;  // to type for it, if that is how it is done
    std::string modes;                  // what it offers, where that was asked; else empty
};

// One report per camera, ordered by port.  kOk    else as UsbLink::enumerate
[[nodiscard]] UsbStatus check_cameras(UsbLink& link, const CameraSurroundings& surroundings,
                                      std::vector<CameraReport>& reports);

// How OpenNI2 names a USB camera: vendor/product@bus/address.
[[nodiscard]] std::string openni2_uri(const UsbDevice& device);

// Resets the camera at `where`: a port ("1-2") or OpenNI2's name of it; empty: the only camera there is. Whoever
// streams from it must have closed it. `message` says what happened, for the user.
//   kOk    kGone: not there, or not the same after the reset    kBusy: somebody streams from it, or several cameras to
//   choose from    kDenied    kFailed    else as UsbLink::enumerate
[[nodiscard]] UsbStatus reset_camera(UsbLink& link, std::string_view where, std::string& message);

}  // namespace stillmesh
