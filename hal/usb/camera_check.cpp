#include "hal/usb/camera_check.hpp"

#include <algorithm>
#include <array>
#include <cstdio>

namespace stillmesh {
namespace {

constexpr std::uint8_t kGetStatus = 0;
constexpr std::uint8_t kToDevice = 0x80;
constexpr std::uint8_t kToEndpoint = 0x82;

using Devices = std::vector<UsbDevice>;

void find(CameraReport& report, CameraVerdict verdict, std::string problem, std::string advice,
          std::vector<std::string> commands = {}) {
    report.verdict = verdict;
    report.problem = std::move(problem);
    report.advice = std::move(advice);
    report.commands = std::move(commands);
}

[[nodiscard]] const UsbDevice* device_at(const Devices& devices, const UsbPort& port) {
    const auto found =
        std::find_if(devices.begin(), devices.end(), [&](const UsbDevice& device) { return device.port == port; });
    return found == devices.end() ? nullptr : &*found;
}

[[nodiscard]] std::string hub_text(const UsbPort& hub) {
    return hub.depth == 0 ? "the computer's own port" : "the hub at " + port_text(hub);
}

// The Kinect's parts sit on a hub inside it, or below the motor, which is that hub in later models.
[[nodiscard]] bool has_kinect_camera(const Devices& devices, const UsbPort& motor) {
    return std::any_of(devices.begin(), devices.end(), [&](const UsbDevice& device) {
        const SupportedCamera* const camera = find_supported_camera(device.vendor_id, device.product_id);
        return camera != nullptr && camera->role == CameraRole::kCamera && camera->driver == CameraDriver::kFreenect &&
               (hub_of(device.port) == hub_of(motor) || hub_of(device.port) == motor);
    });
}

// What a look at the bus tells. True: something was found.
[[nodiscard]] bool find_on_bus(const Devices& devices, CameraReport& report) {
    const SupportedCamera& camera = *report.camera;
    const UsbDevice& device = report.device;
    const UsbPort hub_port = hub_of(device.port);
    const UsbDevice* const hub = device_at(devices, hub_port);
    if (camera.role == CameraRole::kUnsupported) {
        find(report, CameraVerdict::kUnsupported, std::string("Stillmesh cannot use it: ") + camera.remark,
             "use an ASUS Xtion PRO Live, an Intel RealSense D4xx, an Orbbec Astra or a Kinect for Xbox 360");
    } else if (camera.role == CameraRole::kBootloader) {
        find(report, CameraVerdict::kBootloader, "it has not loaded its firmware and waits in its boot loader",
             "unplug it for ten seconds and plug it in again, straight into the computer; if that does not help, load "
             "its firmware with Orbbec's update tool");
    } else if (camera.role == CameraRole::kKinectMotor) {
        find(report, CameraVerdict::kNoCamera, "its motor is there but its camera is not: it gets no power",
             "plug in the Kinect's own power supply (12 V); the USB port alone does not feed the camera");
    } else if (!device.is_configured) {
        const bool is_weak_hub = hub != nullptr && hub_port.depth > 0 && !hub->is_self_powered;
        find(report, CameraVerdict::kNoPower,
             "it is switched off: it asks for " + std::to_string(device.power_ma) + " mA and " + hub_text(hub_port) +
                 (is_weak_hub ? " has no power supply of its own" : " does not give that much"),
             is_weak_hub ? "plug it straight into the computer" : "plug it into a hub with its own power supply");
    } else if (device.speed == UsbSpeed::kLow || device.speed == UsbSpeed::kFull) {
        const bool is_slow_hub = hub != nullptr && hub_port.depth > 0 && hub->speed == UsbSpeed::kFull;
        find(report, CameraVerdict::kTooSlow,
             "it is connected at " + speed_text(device.speed) + ", too slow for images",
             is_slow_hub ? hub_text(hub_port) + " is USB 1: plug the camera into a USB 2 or USB 3 port"
                         : "plug it with another cable into a USB 2 or USB 3 port of the computer");
    } else if (camera.role == CameraRole::kDepthOnly) {
        find(report, CameraVerdict::kDepthOnly, std::string("Stillmesh needs colour and depth: ") + camera.remark,
             "use a camera with both behind one driver, such as an ASUS Xtion PRO Live or an Orbbec Astra");
    } else {
        return false;
    }
    return true;
}

[[nodiscard]] bool find_driver(const CameraSurroundings& surroundings, CameraReport& report) {
    const CameraDriver driver = report.camera->driver;
    const std::string name = driver_name(driver);
    if (driver == CameraDriver::kFreenect) {
        if (surroundings.has_freenect) return false;
        find(report, CameraVerdict::kDriverMissing, "this program was built without " + name,
             "install the library and build again",
             {"sudo apt-get install libfreenect-dev", "cmake --preset release -DSTILLMESH_WITH_FREENECT=ON",
              "cmake --build build/release"});
        return true;
    }
    if (!surroundings.has_openni2) {
        find(report, CameraVerdict::kDriverMissing, "this program was built without OpenNI2",
             "install the library and build again",
             {"sudo apt-get install libopenni2-dev", "cmake --preset release -DSTILLMESH_WITH_OPENNI2=ON",
              "cmake --build build/release"});
        return true;
    }
    // OpenNI2 as Debian builds it loads lib*.so.0 only.
    const std::string file = std::string(openni2_plug_in(driver)) + ".so.0";
    const auto is_in = [&file](const std::vector<std::string>& files) {
        return std::find(files.begin(), files.end(), file) != files.end();
    };
    if (is_in(surroundings.plug_ins)) return false;
    const std::string problem =
        "OpenNI2's driver for it, " + file +
        (is_in(surroundings.unusable_plug_ins) ? ", is damaged or for another processor, in " : ", is not in ") +
        surroundings.plug_in_folder;
    if (driver == CameraDriver::kOrbbec) {
        find(report, CameraVerdict::kDriverMissing, problem,
             "download Orbbec's OpenNI SDK for this processor (orbbec.com, Developers; Debian does not have it) and "
             "copy "
             "the driver from it",
             {"sudo cp liborbbec.so " + surroundings.plug_in_folder + "/" + file});
    } else {
        find(report, CameraVerdict::kDriverMissing, problem, "install OpenNI2 again",
             {"sudo apt-get install --reinstall libopenni2-0"});
    }
    return true;
}

void find_denied(const UsbNode& node, const CameraSurroundings& surroundings, CameraReport& report) {
    const std::string problem = "this user may not open " + node.path;
    if (node.group == kUdevGroup && (node.mode & 0060U) == 0060U) {
        find(report, CameraVerdict::kDenied, problem + ", which the group '" + node.group + "' may",
             "join the group, then log out and in again", {"sudo usermod -aG " + node.group + " \"$USER\""});
    } else if (!surroundings.rule_files.empty()) {
        find(report, CameraVerdict::kDenied,
             problem + ": the udev rules are installed (" + surroundings.rule_files.front() +
                 ") but have not been applied to it",
             "apply them; if it still fails, unplug the camera and plug it in again",
             {"sudo udevadm control --reload", "sudo udevadm trigger --subsystem-match=usb"});
    } else {
        find(report, CameraVerdict::kDenied, problem + ": the udev rules are missing",
             "install them; if it still fails, unplug the camera and plug it in again",
             {std::string("stillmesh cameras --udev-rules | sudo tee ") + kUdevRulesFile,
              "sudo udevadm control --reload", "sudo udevadm trigger --subsystem-match=usb"});
    }
}

void find_held(UsbLink& link, CameraReport& report) {
    const std::string driver = link.kernel_driver(report.device);
    const std::vector<UsbHolder> holders = link.holders(report.device);
    if (!holders.empty()) {
        std::string who;
        for (const UsbHolder& holder : holders) {
            who += (who.empty() ? "" : " and ") + holder.name + " (process " + std::to_string(holder.pid) + ")";
        }
        find(report, CameraVerdict::kHeld, "another program uses it: " + who, "end that program first",
             {"kill " + std::to_string(holders.front().pid)});
    } else if (!driver.empty() && driver != "usbfs") {
        find(report, CameraVerdict::kHeld, "the kernel's driver " + driver + " has taken it",
             "unload that driver, and keep it from coming back",
             {"sudo modprobe -r " + driver,
              "echo blacklist " + driver + " | sudo tee /etc/modprobe.d/stillmesh-" + driver + ".conf"});
    } else {
        find(report, CameraVerdict::kHeld, "another user's program uses it", "ask as root which it is, and end it",
             {"sudo stillmesh cameras"});
    }
}

// What its video nodes tell of a camera that V4L2 serves. Nobody else opens it meanwhile: it may stream.
void find_in_video_nodes(UsbLink& link, const CameraSurroundings& surroundings, CameraReport& report) {
    if (!surroundings.has_v4l2) {
        find(report, CameraVerdict::kDriverMissing, "this program was built without V4L2",
             "install the kernel's headers and build again",
             {"sudo apt-get install linux-libc-dev", "cmake --preset release -DSTILLMESH_WITH_V4L2=ON",
              "cmake --build build/release"});
        return;
    }
    const auto nodes =
        std::find_if(surroundings.video_nodes.begin(), surroundings.video_nodes.end(),
                     [&report](const VideoNodes& one) { return one.usb_port == port_text(report.device.port); });
    if (nodes == surroundings.video_nodes.end()) {
        // A program with a USB driver of its own sends the kernel's away.
        if (link.kernel_driver(report.device) == "usbfs") {
            find_held(link, report);
        } else {
            find(report, CameraVerdict::kDriverMissing,
                 "the kernel has no video node for it: its driver uvcvideo is not loaded, or has not taken it",
                 "load it; if it still fails, unplug the camera and plug it in again", {"sudo modprobe uvcvideo"});
        }
        return;
    }
    report.modes = "depth " + (nodes->depth_modes.empty() ? "none" : nodes->depth_modes) + "; colour " +
                   (nodes->colour_modes.empty() ? "none" : nodes->colour_modes);
    if (!nodes->absent.empty()) {
        find(report, CameraVerdict::kNoNode, "its file " + nodes->absent + " is not there, as in a container",
             "start the container with the camera's video nodes", {"docker run --device " + nodes->absent + " ..."});
    } else if (!nodes->denied.empty()) {
        find(report, CameraVerdict::kDenied,
             "this user may not open " + nodes->denied + ", which the group '" + kUdevGroup + "' may",
             "join the group, then log out and in again",
             {std::string("sudo usermod -aG ") + kUdevGroup + " \"$USER\""});
    } else if (!nodes->busy.empty()) {
        find(report, CameraVerdict::kHeld, "another program streams from " + nodes->busy, "ask which it is, and end it",
             {"sudo fuser -v " + nodes->busy});
    } else if (!nodes->broken.empty() || nodes->depth_modes.empty() || nodes->colour_modes.empty()) {
        find(report, CameraVerdict::kNoAnswer,
             "it is stuck: " + (nodes->broken.empty() ? std::string("it offers no modes of ") +
                                                            (nodes->depth_modes.empty() ? "depth" : "colour")
                                                      : nodes->broken + " does not answer as a camera does"),
             "reset it; if that does not help, unplug it and plug it in again",
             {"stillmesh cameras --reset " + port_text(report.device.port)});
    } else if (report.device.speed == UsbSpeed::kHigh) {
        find(report, CameraVerdict::kSlowBus, "it is connected as USB 2, which leaves it its smaller modes",
             "plug it with a USB 3 cable into a USB 3 port");
    }
}

[[nodiscard]] bool is_halted(UsbLink& link, UsbHandle handle, const UsbDevice& device) {
    for (const std::uint8_t endpoint : device.endpoints_in) {
        std::array<std::uint8_t, 2> answer{};
        std::size_t count = 0;
        if (endpoint == 0) break;
        if (link.control_in(handle, kToEndpoint, kGetStatus, 0, endpoint, answer, count, kAnswerMax_ms) ==
                UsbStatus::kOk &&
            count == answer.size() && (answer[0] & 1U) != 0) {
            return true;
        }
    }
    return false;
}

// What opening tells. Nothing else is found when somebody else has it.
void find_by_opening(UsbLink& link, const CameraSurroundings& surroundings, CameraReport& report) {
    const UsbNode node = link.node(report.device);
    if (!node.exists) {
        find(report, CameraVerdict::kNoNode, "its file " + node.path + " is not there, as in a container",
             "start the container with the host's USB devices", {"docker run --device /dev/bus/usb ..."});
        return;
    }
    const auto silent = [&](const std::string& how) {
        find(report, CameraVerdict::kNoAnswer, "it is stuck: " + how,
             "reset it; if that does not help, unplug it and plug it in again",
             {"stillmesh cameras --reset " + port_text(report.device.port)});
    };
    UsbHandle handle;
    switch (const UsbStatus status = link.open(report.device, handle); status) {
        case UsbStatus::kOk: break;
        case UsbStatus::kDenied: find_denied(node, surroundings, report); return;
        case UsbStatus::kBusy: find_held(link, report); return;
        default: silent(std::string("opening it says \"") + usb_status_name(status) + "\""); return;
    }
    const UsbStatus claimed = link.claim(handle, 0);
    if (claimed == UsbStatus::kBusy) {
        const std::string driver = link.kernel_driver(report.device);
        // libfreenect itself sends a kernel driver away.
        const bool is_sent_away =
            report.camera->driver == CameraDriver::kFreenect && !driver.empty() && driver != "usbfs";
        link.close(handle);
        if (!is_sent_away) find_held(link, report);
        return;
    }
    std::array<std::uint8_t, 2> answer{};
    std::size_t count = 0;
    const UsbStatus answered = link.control_in(handle, kToDevice, kGetStatus, 0, 0, answer, count, kAnswerMax_ms);
    // To refuse is an answer too.
    if (claimed != UsbStatus::kOk) {
        silent(std::string("claiming it says \"") + usb_status_name(claimed) + "\"");
    } else if (answered != UsbStatus::kOk && answered != UsbStatus::kStalled) {
        silent(std::string("asked how it is, it says \"") + usb_status_name(answered) + "\"");
    } else if (is_halted(link, handle, report.device)) {
        silent("it has halted its image stream");
    }
    link.close(handle);
}

// Cameras that would stream at the same time over one USB 2 bus; one held by another process streams already.
void find_shared_buses(std::vector<CameraReport>& reports) {
    const auto takes_part = [](const CameraReport& report) {
        return report.device.speed == UsbSpeed::kHigh &&
               (can_stream(report.verdict) || report.verdict == CameraVerdict::kHeld);
    };
    for (CameraReport& report : reports) {
        const bool is_fit = report.verdict == CameraVerdict::kReady || report.verdict == CameraVerdict::kSlowBus;
        if (!is_fit || !takes_part(report)) continue;
        std::string others;
        std::uint32_t megabytes = kCameraMegabytesPerS;
        for (const CameraReport& other : reports) {
            if (&other == &report || !takes_part(other) || other.device.port.bus != report.device.port.bus) continue;
            others += (others.empty() ? "" : " and ") + port_text(other.device.port);
            megabytes += kCameraMegabytesPerS;
        }
        if (megabytes <= kUsb2MegabytesPerS) continue;
        find(report, CameraVerdict::kSharedBus,
             "it shares a USB 2 bus with the camera at " + others + ": together they need " +
                 std::to_string(megabytes) + " MB/s, the bus carries some " + std::to_string(kUsb2MegabytesPerS),
             "plug one of them into a port of another USB controller; until then, use one at a time");
    }
}

}  // namespace

const char* verdict_name(CameraVerdict verdict) noexcept {
    switch (verdict) {
        case CameraVerdict::kReady: return "ready";
        case CameraVerdict::kSlowBus: return "usb_2";
        case CameraVerdict::kSharedBus: return "shared_bus";
        case CameraVerdict::kUnsupported: return "unsupported";
        case CameraVerdict::kBootloader: return "boot_loader";
        case CameraVerdict::kNoCamera: return "power_supply_missing";
        case CameraVerdict::kNoPower: return "not_enough_power";
        case CameraVerdict::kTooSlow: return "too_slow";
        case CameraVerdict::kDepthOnly: return "depth_only";
        case CameraVerdict::kDriverMissing: return "driver_missing";
        case CameraVerdict::kNoNode: return "not_in_container";
        case CameraVerdict::kDenied: return "permission_denied";
        case CameraVerdict::kHeld: return "in_use";
        case CameraVerdict::kNoAnswer: return "stuck";
    }
    return "unknown";
}

UsbStatus check_cameras(UsbLink& link, const CameraSurroundings& surroundings, std::vector<CameraReport>& reports) {
    reports.clear();
    Devices devices;
    if (const UsbStatus status = link.enumerate(devices); status != UsbStatus::kOk) return status;
    for (const UsbDevice& device : devices) {
        const SupportedCamera* const camera = find_supported_camera(device.vendor_id, device.product_id);
        if (camera == nullptr || camera->role == CameraRole::kKinectPart) continue;
        if (camera->role == CameraRole::kKinectMotor && has_kinect_camera(devices, device.port)) continue;
        CameraReport report;
        report.camera = camera;
        report.device = device;
        if (!find_on_bus(devices, report)) {
            if (camera->driver == CameraDriver::kV4l2) {
                find_in_video_nodes(link, surroundings, report);
            } else if (!find_driver(surroundings, report)) {
                find_by_opening(link, surroundings, report);
            }
        }
        reports.push_back(std::move(report));
    }
    find_shared_buses(reports);
    return UsbStatus::kOk;
}

std::string openni2_uri(const UsbDevice& device) {
    char text[40];
    std::snprintf(text, sizeof(text), "%04x/%04x@%u/%u", static_cast<unsigned>(device.vendor_id),
                  static_cast<unsigned>(device.product_id), static_cast<unsigned>(device.port.bus),
                  static_cast<unsigned>(device.address));
    return text;
}

UsbStatus reset_camera(UsbLink& link, std::string_view where, std::string& message) {
    Devices devices;
    if (const UsbStatus status = link.enumerate(devices); status != UsbStatus::kOk) {
        message = std::string("the USB bus cannot be read: ") + usb_status_name(status);
        return status;
    }
    std::erase_if(devices, [&](const UsbDevice& device) {
        const SupportedCamera* const camera = find_supported_camera(device.vendor_id, device.product_id);
        const bool is_camera = camera != nullptr && camera->role != CameraRole::kKinectPart &&
                               camera->role != CameraRole::kKinectMotor && camera->role != CameraRole::kUnsupported;
        return !is_camera || !(where.empty() || where == port_text(device.port) || where == openni2_uri(device));
    });
    if (devices.empty()) {
        message = where.empty() ? "there is no camera to reset" : "there is no camera at " + std::string(where);
        return UsbStatus::kGone;
    }
    if (devices.size() > 1) {
        message = "there are several cameras: name the port, such as " + port_text(devices.front().port);
        return UsbStatus::kBusy;
    }
    const UsbDevice& device = devices.front();
    const std::string name = "the camera at " + port_text(device.port);
    UsbHandle handle;
    UsbStatus status = link.open(device, handle);
    if (status == UsbStatus::kOk) {
        // A reset would tear it from whoever streams.
        status = link.claim(handle, 0);
        const std::string driver = status == UsbStatus::kBusy ? link.kernel_driver(device) : std::string();
        if (status == UsbStatus::kBusy && (driver.empty() || driver == "usbfs")) {
            link.close(handle);
            message = name + " is in use by another program: end that first";
            return status;
        }
        status = link.reset(handle);
    }
    if (status == UsbStatus::kOk) {
        message = name + " was reset";
    } else if (status == UsbStatus::kGone) {
        message = name + " did not come back as it was: if 'stillmesh cameras' does not show it, plug it in again";
    } else {
        message = name + " could not be reset (" + usb_status_name(status) + ")" +
                  (status == UsbStatus::kDenied ? ": 'stillmesh cameras' says how to get permission" : "");
    }
    return status;
}

}  // namespace stillmesh
