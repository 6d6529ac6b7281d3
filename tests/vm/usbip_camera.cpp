// A depth camera for a real kernel without one: an ASUS Xtion PRO Live. It answers what enumeration, a claim and a
// status request ask; it has no images. Needs root.
//   usbip_camera COMMAND [ARGUMENTS]          runs the command with the camera plugged in; its exit code is the
//                                             command's
//   usbip_camera --as UID COMMAND [ARGUMENTS] only runs the command, as that user (there may be no other way on a
//                                             board)
#include <grp.h>
#include <poll.h>
#include <sys/wait.h>
#include <unistd.h>

#include <cstdio>
#include <cstdlib>
#include <string>

#include "tests/vm/usbip.hpp"

namespace {

using vm::Bytes;

Bytes configuration_descriptor() {
    Bytes bytes = {9, 2, 0, 0, 1, 1, 0, 0x80, 250, 9, 4, 0, 0, 3, 0xff, 0, 0, 0};
    for (const int endpoint : {0x81, 0x82, 0x83}) {
        bytes.insert(bytes.end(), {7, 5, static_cast<std::uint8_t>(endpoint), 2, 0x00, 0x02, 0});
    }
    bytes[2] = static_cast<std::uint8_t>(bytes.size());
    return bytes;
}

class Xtion final : public vm::UsbDevice {
public:
    Xtion() {
        answers_.device = {18, 1, 0x00, 0x02, 0, 0, 0, 64, 0x27, 0x1d, 0x01, 0x06, 0x01, 0x00, 2, 1, 3, 1};
        answers_.configuration = configuration_descriptor();
        answers_.strings = {{4, 3, 0x09, 0x04},
                            vm::usb_string("Xtion PRO Live (emulated)"),
                            vm::usb_string("ASUS"),
                            vm::usb_string("SYN0001")};
    }
    bool control(const vm::Setup& setup, const Bytes& written, Bytes& data) override {
        static_cast<void>(written);
        return answers_.answer(setup, data);
    }

private:
    vm::StandardAnswers answers_;
};

bool is_taken() {
    return ::access("/sys/bus/usb/devices/1-1/bConfigurationValue", R_OK) == 0 &&
           ::access("/sys/bus/usb/devices/1-1:1.0", F_OK) == 0;
}

// Serves until `is_over` says so, asked every 50 ms at least; false: not within `rounds` of these.
template <typename Condition>
bool serve_until(vm::UsbPort& port, int rounds, Condition is_over) {
    while (rounds != 0) {
        if (is_over()) return true;
        pollfd file = {port.socket(), POLLIN, 0};
        if (::poll(&file, 1, 50) > 0) {
            port.serve_one();
        } else {
            --rounds;
        }
    }
    return false;
}

}  // namespace

int main(int argc, char** argv) {
    if (argc > 3 && std::string(argv[1]) == "--as") {
        const auto id = static_cast<uid_t>(std::strtoul(argv[2], nullptr, 10));
        if (::setgroups(0, nullptr) != 0 || ::setresgid(id, id, id) != 0 || ::setresuid(id, id, id) != 0) return 2;
        ::execvp(argv[3], argv + 3);
        std::perror(argv[3]);
        return 127;
    }
    if (argc < 2) return 2;
    Xtion camera;
    vm::UsbPort port(camera);
    if (!port.plug(vm::UsbSpeed::kHigh)) return 2;
    if (!serve_until(port, 600, is_taken)) {
        std::fprintf(stderr, "the kernel did not take the camera\n");
        return 2;
    }
    const pid_t command = ::fork();
    if (command == 0) {
        ::execvp(argv[1], argv + 1);
        std::perror(argv[1]);
        ::_exit(127);
    }
    int status = 0;
    static_cast<void>(serve_until(port, -1, [&] { return ::waitpid(command, &status, WNOHANG) != 0; }));
    return WIFEXITED(status) ? WEXITSTATUS(status) : 1;
}
