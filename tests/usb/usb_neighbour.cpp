// Another process on the bus. `hold PORT`: opens and claims a device, says "held", and keeps it until its input ends.
// `check [UID]`: says what `stillmesh cameras` finds, as that user, with every driver installed and no udev rules.
#include <grp.h>
#include <unistd.h>

#include <cstdio>
#include <cstdlib>
#include <string>
#include <vector>

#include "hal/usb/camera_check.hpp"
#include "hal/usb/libusb_link.hpp"
#include "platform/cli/cameras_command.hpp"

namespace stillmesh {
namespace {

int hold(const char* port) {
    LibusbLink link;
    std::vector<UsbDevice> devices;
    if (link.enumerate(devices) != UsbStatus::kOk) return 1;
    for (const UsbDevice& device : devices) {
        UsbHandle handle;
        if (port_text(device.port) != port || link.open(device, handle) != UsbStatus::kOk) continue;
        const UsbStatus status = link.claim(handle, 0);
        std::printf("%s\n", status == UsbStatus::kOk ? "held" : usb_status_name(status));
        std::fflush(stdout);
        while (std::getchar() != EOF) {
        }
        return 0;
    }
    return 1;
}

int check(const char* uid) {
    if (uid != nullptr) {
        const auto id = static_cast<uid_t>(std::strtoul(uid, nullptr, 10));
        if (::setgroups(0, nullptr) != 0 || ::setresgid(id, id, id) != 0 || ::setresuid(id, id, id) != 0) return 1;
    }
    LibusbLink link;
    CameraSurroundings surroundings;
    surroundings.has_openni2 = true;
    surroundings.plug_ins = {"libPS1080.so.0"};
    std::vector<CameraReport> reports;
    const UsbStatus status = check_cameras(link, surroundings, reports);
    std::printf("%s", status == UsbStatus::kOk ? cameras_text(reports).c_str() : usb_status_name(status));
    return 0;
}

}  // namespace
}  // namespace stillmesh

int main(int argc, char** argv) {
    const std::string what = argc > 1 ? argv[1] : "";
    if (what == "hold" && argc == 3) return stillmesh::hold(argv[2]);
    if (what == "check") return stillmesh::check(argc > 2 ? argv[2] : nullptr);
    return 2;
}
