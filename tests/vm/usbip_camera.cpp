// A depth camera for a real kernel without one: an ASUS Xtion PRO Live that the kernel reaches through vhci-hcd, its
// virtual host controller, over a socket (USB/IP, Documentation/usb/usbip_protocol.rst). It answers what enumeration, a
// claim and a status request ask; it has no images. Needs root.
//   usbip_camera COMMAND [ARGUMENTS]          runs the command with the camera plugged in; its exit code is the
//   command's usbip_camera --as UID COMMAND [ARGUMENTS] only runs the command, as that user (there may be no other way
//   on a board)
#include <arpa/inet.h>
#include <fcntl.h>
#include <grp.h>
#include <sys/socket.h>
#include <sys/wait.h>
#include <unistd.h>

#include <cerrno>
#include <cstdint>
#include <cstdio>
#include <cstdlib>
#include <cstring>
#include <string>
#include <vector>

namespace {

using Bytes = std::vector<std::uint8_t>;

constexpr std::uint32_t kSubmit = 1, kUnlink = 2, kSubmitAnswer = 3, kUnlinkAnswer = 4;
constexpr char kController[] = "/sys/devices/platform/vhci_hcd.0/";

struct Header {
    std::uint32_t command, sequence, device, direction, endpoint;
    std::uint32_t words[5];  // flags, length, start frame, packets, interval; in answers status, length, ...
    std::uint8_t setup[8];
};
static_assert(sizeof(Header) == 48);

Bytes device_descriptor() {
    return {18, 1, 0x00, 0x02, 0, 0, 0, 64, 0x27, 0x1d, 0x01, 0x06, 0x01, 0x00, 2, 1, 3, 1};
}

Bytes configuration_descriptor() {
    Bytes bytes = {9, 2, 0, 0, 1, 1, 0, 0x80, 250, 9, 4, 0, 0, 3, 0xff, 0, 0, 0};
    for (const int endpoint : {0x81, 0x82, 0x83}) {
        bytes.insert(bytes.end(), {7, 5, static_cast<std::uint8_t>(endpoint), 2, 0x00, 0x02, 0});
    }
    bytes[2] = static_cast<std::uint8_t>(bytes.size());
    return bytes;
}

Bytes string_descriptor(int index) {
    if (index == 0) return {4, 3, 0x09, 0x04};
    const char* const texts[] = {"Xtion PRO Live (emulated)", "ASUS", "SYN0001"};
    if (index > 3) return {};
    Bytes bytes = {0, 3};
    for (const char* letter = texts[index - 1]; *letter != 0; ++letter) {
        bytes.push_back(static_cast<std::uint8_t>(*letter));
        bytes.push_back(0);
    }
    bytes[0] = static_cast<std::uint8_t>(bytes.size());
    return bytes;
}

// What a control request reads; false: the device does not know it.
bool answer(const std::uint8_t* setup, Bytes& data) {
    const bool is_read = (setup[0] & 0x80U) != 0;
    if ((setup[0] & 0x60U) != 0) return false;
    if (!is_read) return true;  // addresses, configurations, features
    switch (setup[1]) {
        case 0: data = {0, 0}; return true;
        case 6:
            data = setup[3] == 1   ? device_descriptor()
                   : setup[3] == 2 ? configuration_descriptor()
                   : setup[3] == 3 ? string_descriptor(setup[2])
                                   : Bytes{};
            return !data.empty();
        case 8: data = {1}; return true;
        case 10: data = {0}; return true;
        default: return false;
    }
}

bool read_all(int file, void* to, std::size_t size) {
    for (auto* at = static_cast<std::uint8_t*>(to); size > 0;) {
        const ssize_t count = ::read(file, at, size);
        if (count <= 0) return false;
        at += count;
        size -= static_cast<std::size_t>(count);
    }
    return true;
}

bool write_all(int file, const Bytes& bytes) {
    for (std::size_t done = 0; done < bytes.size();) {
        const ssize_t count = ::write(file, bytes.data() + done, bytes.size() - done);
        if (count <= 0) return false;
        done += static_cast<std::size_t>(count);
    }
    return true;
}

// Until the kernel hangs up.
void serve(int socket) {
    Header request{};
    while (read_all(socket, &request, sizeof(request))) {
        const std::uint32_t command = ntohl(request.command);
        const std::uint32_t length = ntohl(request.words[1]);
        Header reply{};
        reply.sequence = request.sequence;
        Bytes data;
        if (command == kSubmit) {
            Bytes written(ntohl(request.direction) == 0 ? length : 0);
            if (!read_all(socket, written.data(), written.size())) return;
            const bool is_known = ntohl(request.endpoint) == 0 && answer(request.setup, data);
            if (!is_known) data.clear();
            if (data.size() > length) data.resize(length);
            reply.command = htonl(kSubmitAnswer);
            reply.words[0] = htonl(static_cast<std::uint32_t>(is_known ? 0 : -EPIPE));
            reply.words[1] = htonl(static_cast<std::uint32_t>(written.empty() ? data.size() : written.size()));
            reply.words[3] = 0xffffffff;  // not isochronous
        } else if (command == kUnlink) {
            reply.command = htonl(kUnlinkAnswer);  // too late: it has been answered
        } else {
            return;
        }
        Bytes bytes(sizeof(reply));
        std::memcpy(bytes.data(), &reply, sizeof(reply));
        bytes.insert(bytes.end(), data.begin(), data.end());
        if (!write_all(socket, bytes)) return;
    }
}

bool tell_controller(const char* name, const std::string& text) {
    const int file = ::open((std::string(kController) + name).c_str(), O_WRONLY | O_CLOEXEC);
    const bool is_told = file >= 0 && ::write(file, text.data(), text.size()) == static_cast<ssize_t>(text.size());
    if (!is_told) std::perror(name);
    if (file >= 0) static_cast<void>(::close(file));
    return is_told;
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
    int sockets[2];
    if (argc < 2 || ::socketpair(AF_UNIX, SOCK_STREAM, 0, sockets) != 0) return 2;
    const pid_t camera = ::fork();
    if (camera == 0) {
        static_cast<void>(::close(sockets[0]));
        serve(sockets[1]);
        ::_exit(0);
    }
    static_cast<void>(::close(sockets[1]));
    // Port, socket, device number of bus 1, high speed.
    if (!tell_controller("attach", "0 " + std::to_string(sockets[0]) + " 65538 3")) return 2;
    bool is_there = false;
    for (int i = 0; i < 600 && !is_there; ++i) {
        static_cast<void>(::usleep(50'000));
        is_there = ::access("/sys/bus/usb/devices/1-1/bConfigurationValue", R_OK) == 0 &&
                   ::access("/sys/bus/usb/devices/1-1:1.0", F_OK) == 0;
    }
    if (!is_there) {
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
    static_cast<void>(::waitpid(command, &status, 0));
    static_cast<void>(tell_controller("detach", "0"));
    return WIFEXITED(status) ? WEXITSTATUS(status) : 1;
}
