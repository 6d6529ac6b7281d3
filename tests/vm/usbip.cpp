#include "tests/vm/usbip.hpp"

#include <arpa/inet.h>
#include <fcntl.h>
#include <sys/socket.h>
#include <unistd.h>

#include <algorithm>
#include <cerrno>
#include <cstdio>
#include <cstring>

namespace vm {
namespace {

constexpr std::uint32_t kSubmit = 1, kUnlink = 2, kSubmitAnswer = 3, kUnlinkAnswer = 4;
constexpr std::size_t kHeaderBytes = 48;
constexpr char kController[] = "/sys/devices/platform/vhci_hcd.0/";
// Words of a header: command, sequence, device, direction, endpoint, then by command.
constexpr std::size_t kSequence = 1, kDirection = 3, kEndpoint = 4, kLength = 6, kUnlinked = 5, kSetup = 40;

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
        const ssize_t count = ::send(file, bytes.data() + done, bytes.size() - done, MSG_NOSIGNAL);
        if (count <= 0) return false;
        done += static_cast<std::size_t>(count);
    }
    return true;
}

bool tell_controller(const char* name, const std::string& text) {
    const int file = ::open((std::string(kController) + name).c_str(), O_WRONLY | O_CLOEXEC);
    const bool is_told = file >= 0 && ::write(file, text.data(), text.size()) == static_cast<ssize_t>(text.size());
    const int error = errno;
    if (file >= 0) static_cast<void>(::close(file));
    errno = error;
    return is_told;
}

void put_big(Bytes& bytes, std::uint32_t value) {
    for (int shift = 24; shift >= 0; shift -= 8) bytes.push_back(static_cast<std::uint8_t>(value >> shift));
}

// An answer's header: it has no device, direction or endpoint.
Bytes header(std::uint32_t command, std::uint32_t sequence, std::int32_t status, std::uint32_t length) {
    Bytes bytes;
    bytes.reserve(kHeaderBytes);
    for (const std::uint32_t word : {command, sequence, 0U, 0U, 0U}) put_big(bytes, word);
    put_big(bytes, static_cast<std::uint32_t>(status));
    put_big(bytes, length);
    put_big(bytes, 0);
    put_big(bytes, 0xffffffffU);  // not isochronous
    bytes.resize(kHeaderBytes);
    return bytes;
}

}  // namespace

void put16(Bytes& bytes, std::uint32_t value) {
    bytes.push_back(static_cast<std::uint8_t>(value));
    bytes.push_back(static_cast<std::uint8_t>(value >> 8U));
}

void put32(Bytes& bytes, std::uint32_t value) {
    put16(bytes, value);
    put16(bytes, value >> 16U);
}

Bytes usb_string(const std::string& text) {
    Bytes bytes = {static_cast<std::uint8_t>(2 + 2 * text.size()), 3};
    for (const char letter : text) put16(bytes, static_cast<std::uint8_t>(letter));
    return bytes;
}

bool StandardAnswers::answer(const Setup& setup, Bytes& data) const {
    constexpr std::uint8_t kGetStatus = 0, kGetDescriptor = 6, kGetConfiguration = 8, kGetInterface = 10;
    if ((setup.type & 0x60U) != 0) return false;
    if ((setup.type & 0x80U) == 0) return true;  // addresses, configurations, features
    const std::size_t number = setup.value & 0xffU;
    switch (setup.request) {
        case kGetStatus: data = {0, 0}; return true;
        case kGetConfiguration: data = {1}; return true;
        case kGetInterface: data = {0}; return true;
        case kGetDescriptor:
            switch (setup.value >> 8U) {
                case 1: data = device; break;
                case 2: data = configuration; break;
                case 3: data = number < strings.size() ? strings[number] : Bytes{}; break;
                case 15: data = capabilities; break;
                default: break;
            }
            return !data.empty();
        default: return false;
    }
}

bool UsbPort::plug(UsbSpeed speed) {
    unplug();
    int sockets[2];
    if (::socketpair(AF_UNIX, SOCK_STREAM | SOCK_CLOEXEC, 0, sockets) != 0) return false;
    const int wide = 1 << 20;
    static_cast<void>(::setsockopt(sockets[1], SOL_SOCKET, SO_SNDBUF, &wide, sizeof(wide)));
    // Port, socket, device number of bus 1, speed. The kernel has two hubs and chooses the port of the one that is as
    // fast.
    const std::string text =
        "0 " + std::to_string(sockets[0]) + " 65538 " + std::to_string(static_cast<unsigned>(speed));
    bool is_told = false;
    for (int i = 0; i < 100 && !is_told; ++i) {  // busy for a moment after the last one was unplugged
        if (i > 0) static_cast<void>(::usleep(20'000));
        is_told = tell_controller("attach", text);
    }
    if (!is_told) std::perror("attach");
    static_cast<void>(::close(sockets[0]));
    if (is_told) {
        socket_ = sockets[1];
        speed_ = speed;
    } else {
        static_cast<void>(::close(sockets[1]));
    }
    return is_told;
}

void UsbPort::unplug() {
    if (socket_ < 0) return;
    static_cast<void>(tell_controller("detach", speed_ == UsbSpeed::kSuper ? "8" : "0"));
    static_cast<void>(::close(socket_));
    socket_ = -1;
    waiting_.clear();
}

bool UsbPort::answer(std::uint32_t sequence, std::int32_t status, std::uint32_t length, const Bytes& data) {
    Bytes bytes = header(kSubmitAnswer, sequence, status, length);
    bytes.insert(bytes.end(), data.begin(), data.end());
    return write_all(socket_, bytes);
}

bool UsbPort::submit(const std::uint32_t* words, const std::uint8_t* raw) {
    const std::uint32_t length = words[kLength];
    Bytes written(words[kDirection] == 0 ? length : 0), data;
    if (!read_all(socket_, written.data(), written.size())) return false;
    if (words[kEndpoint] != 0 || is_deaf_) {
        waiting_.push_back({words[kSequence], words[kEndpoint], length});
        return true;
    }
    const auto word = [raw](int i) { return static_cast<std::uint16_t>(raw[i] | raw[i + 1] << 8); };
    const bool is_known = device_.control({raw[0], raw[1], word(2), word(4), word(6)}, written, data);
    if (!is_known) data.clear();
    if (data.size() > length) data.resize(length);
    const std::size_t done = !is_known ? 0 : (words[kDirection] == 0 ? written.size() : data.size());
    return answer(words[kSequence], is_known ? 0 : -EPIPE, static_cast<std::uint32_t>(done), data);
}

bool UsbPort::unlink(const std::uint32_t* words) {
    const auto found = std::find_if(waiting_.begin(), waiting_.end(),
                                    [words](const Waiting& one) { return one.sequence == words[kUnlinked]; });
    const bool is_waiting = found != waiting_.end();  // otherwise too late: it has been answered
    if (is_waiting) waiting_.erase(found);
    return write_all(socket_, header(kUnlinkAnswer, words[kSequence], is_waiting ? -ECONNRESET : 0, 0));
}

void UsbPort::serve_one() {
    std::uint8_t raw[kHeaderBytes];
    bool is_well = read_all(socket_, raw, sizeof(raw));
    if (is_well) {
        std::uint32_t words[10];
        std::memcpy(words, raw, sizeof(words));
        for (std::uint32_t& one : words) one = ntohl(one);
        is_well = words[0] == kSubmit ? submit(words, raw + kSetup) : words[0] == kUnlink && unlink(words);
    }
    if (!is_well) unplug();  // the kernel has hung up
}

bool UsbPort::has_waiting(std::uint32_t endpoint) const {
    return std::any_of(waiting_.begin(), waiting_.end(),
                       [endpoint](const Waiting& one) { return one.endpoint == endpoint; });
}

void UsbPort::serve_waiting() {
    Bytes data;
    for (std::size_t i = 0; i < waiting_.size() && is_plugged();) {
        const Waiting one = waiting_[i];
        data.clear();
        if (!device_.bulk(one.endpoint, one.length, data)) {
            ++i;
            continue;
        }
        waiting_.erase(waiting_.begin() + static_cast<std::ptrdiff_t>(i));
        if (!answer(one.sequence, 0, static_cast<std::uint32_t>(data.size()), data)) unplug();
    }
}

}  // namespace vm
