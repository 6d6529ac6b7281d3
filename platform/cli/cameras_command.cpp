#include "platform/cli/cameras_command.hpp"

#include <link.h>

#include <algorithm>
#include <cstdio>
#include <filesystem>
#include <fstream>
#include <nlohmann/json.hpp>

#include "platform/cli/complaint.hpp"
#include "platform/cli/exit_code.hpp"
#ifdef STILLMESH_HAS_USB
#include "hal/usb/libusb_link.hpp"
#endif
#ifdef STILLMESH_HAS_V4L2
#include "hal/v4l2/kernel_link.hpp"
#include "hal/v4l2/survey.hpp"
#endif

namespace stillmesh {
namespace {

// The folder of the OpenNI2 this program has loaded; it looks for its drivers below.
int find_openni2(dl_phdr_info* library, std::size_t, void* folder) {
    const std::string path = library->dlpi_name == nullptr ? "" : library->dlpi_name;
    if (path.find("/libOpenNI2.so") == std::string::npos) return 0;
    *static_cast<std::string*>(folder) = path.substr(0, path.rfind('/'));
    return 1;
}

// What a library's head says about where it runs: word size, byte order, processor. Empty: is no library.
[[nodiscard]] std::string elf_kind(const std::string& file) {
    std::ifstream stream(file, std::ios::binary);
    char head[20] = {};
    if (!stream.read(head, sizeof(head)) || std::string_view(head, 4) !=
                                                "\x7f"
                                                "ELF")
        return {};
    return {head[4], head[5], head[18], head[19]};
}

[[nodiscard]] bool is_of_this_processor(const std::string& library) {
    const std::string kind = elf_kind(library);
    return !kind.empty() && kind == elf_kind("/proc/self/exe");
}

[[nodiscard]] std::string ids(const UsbDevice& device) {
    char text[16];
    std::snprintf(text, sizeof(text), "%04x:%04x", static_cast<unsigned>(device.vendor_id),
                  static_cast<unsigned>(device.product_id));
    return text;
}

[[nodiscard]] std::string how_to_run(const CameraReport& report, bool is_only) {
    if (report.camera->driver == CameraDriver::kFreenect) return "stillmesh run --camera freenect";
    if (report.camera->driver == CameraDriver::kV4l2) {
        const std::string serial = is_only ? std::string() : report.device.serial;
        return "stillmesh run --camera v4l2" + (serial.empty() ? serial : ":" + serial);
    }
    return is_only ? "stillmesh run --camera auto" : "stillmesh run --camera openni2:" + openni2_uri(report.device);
}

#ifdef STILLMESH_HAS_USB
[[nodiscard]] std::string why_no_bus(UsbStatus status) {
    if (status == UsbStatus::kUnsupported) {
        return "this system shows no USB (/dev/bus/usb is not there); in a container, start it with the host's "
               "devices: "
               "docker run --device /dev/bus/usb ...";
    }
    return std::string("the USB bus cannot be read: ") + usb_status_name(status) + ".";
}
#endif

}  // namespace

CameraSurroundings camera_surroundings() {
    CameraSurroundings surroundings;
#ifdef STILLMESH_HAS_OPENNI2
    surroundings.has_openni2 = true;
#endif
#ifdef STILLMESH_HAS_FREENECT
    surroundings.has_freenect = true;
#endif
#ifdef STILLMESH_HAS_V4L2
    KernelV4l2Link video;
    surroundings.has_v4l2 = true;
    surroundings.video_nodes = v4l2::survey(video);
#endif
    std::string library_folder;
    static_cast<void>(::dl_iterate_phdr(&find_openni2, &library_folder));
    std::error_code error;
    if (!library_folder.empty()) {
        surroundings.plug_in_folder = library_folder + "/OpenNI2/Drivers";
        for (const auto& file : std::filesystem::directory_iterator(surroundings.plug_in_folder, error)) {
            (is_of_this_processor(file.path().string()) ? surroundings.plug_ins : surroundings.unusable_plug_ins)
                .push_back(file.path().filename().string());
        }
        std::sort(surroundings.plug_ins.begin(), surroundings.plug_ins.end());
    }
    for (const char* folder : {"/etc/udev/rules.d", "/run/udev/rules.d", "/usr/local/lib/udev/rules.d",
                               "/usr/lib/udev/rules.d", "/lib/udev/rules.d"}) {
        const std::string file = std::string(folder) + "/60-stillmesh.rules";
        if (std::filesystem::exists(file, error)) surroundings.rule_files.push_back(file);
    }
    return surroundings;
}

std::string cameras_text(const std::vector<CameraReport>& reports) {
    if (reports.empty()) {
        return "No depth camera is plugged in.\n"
               "  do        plug one in: an ASUS Xtion PRO Live, a PrimeSense Carmine, an Intel RealSense D4xx, an "
               "Orbbec "
               "Astra or a Kinect for Xbox 360; if it is plugged in, try another cable and another port\n";
    }
    std::string text;
    for (const CameraReport& report : reports) {
        const UsbDevice& device = report.device;
        if (!text.empty()) text += '\n';
        text += std::string(report.camera->name) + " (" + ids(device) + ")";
        if (!device.serial.empty()) text += ", serial " + device.serial;
        text += "\n  at        USB port " + port_text(device.port) + ", " + speed_text(device.speed);
        if (device.power_ma > 0) text += ", asks for " + std::to_string(device.power_ma) + " mA";
        text += "\n  driver    " + std::string(driver_name(report.camera->driver));
        if (!report.modes.empty()) text += "\n  modes     " + report.modes;
        if (report.problem.empty()) {
            text += "\n  streams   yes\n  do        " + how_to_run(report, reports.size() == 1) + "\n";
            continue;
        }
        text += std::string("\n  streams   ") + (can_stream(report.verdict) ? "yes, but " : "no: ") + report.problem +
                "\n  do        " + report.advice;
        text += report.commands.empty() ? "\n" : ":\n";
        for (const std::string& command : report.commands) text += "              " + command + "\n";
    }
    return text;
}

std::string cameras_json(const std::vector<CameraReport>& reports) {
    nlohmann::json list = nlohmann::json::array();
    for (const CameraReport& report : reports) {
        const UsbDevice& device = report.device;
        list.push_back({{"name", report.camera->name},
                        {"id", ids(device)},
                        {"serial", device.serial},
                        {"port", port_text(device.port)},
                        {"openni2_uri", openni2_uri(device)},
                        {"speed_mbit_per_s", mbit_per_s(device.speed)},
                        {"power_ma", device.power_ma},
                        {"driver", driver_name(report.camera->driver)},
                        {"modes", report.modes},
                        {"can_stream", can_stream(report.verdict)},
                        {"verdict", verdict_name(report.verdict)},
                        {"problem", report.problem},
                        {"advice", report.advice},
                        {"commands", report.commands}});
    }
    // Bytes from devices need not be UTF-8.
    return nlohmann::json{{"cameras", list}}.dump(2, ' ', false, nlohmann::json::error_handler_t::replace) + "\n";
}

int cameras_command(const CamerasOptions& options) {
    if (options.is_udev_rules) {
        return answer(udev_rules());
    }
#ifdef STILLMESH_HAS_USB
    LibusbLink link;
    if (options.is_reset) {
        std::string message;
        const UsbStatus status = reset_camera(link, options.reset_port, message);
        if (status == UsbStatus::kOk) {
            std::printf("%s.\n", message.c_str());
            return kExitDone;
        }
        if (status == UsbStatus::kUnsupported) return refuse(why_no_bus(status));
        complain(message + ".");
        return kExitFailed;
    }
    std::vector<CameraReport> reports;
    if (const UsbStatus status = check_cameras(link, camera_surroundings(), reports); status != UsbStatus::kOk) {
        return refuse(why_no_bus(status));
    }
    std::fputs((options.is_json ? cameras_json(reports) : cameras_text(reports)).c_str(), stdout);
    return std::any_of(reports.begin(), reports.end(),
                       [](const CameraReport& report) { return can_stream(report.verdict); })
               ? kExitDone
               : kExitFailed;
#else
    return refuse(
        "this build cannot see USB: libusb was missing when it was made. Install it and build again: sudo apt-get "
        "install "
        "libusb-1.0-0-dev && cmake --preset release -DSTILLMESH_WITH_USB=ON && cmake --build build/release");
#endif
}

}  // namespace stillmesh
