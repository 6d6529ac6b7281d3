// A USB device made of a program: the kernel reaches it through vhci-hcd, its virtual host controller, over a socket
// (USB/IP, Documentation/usb/usbip_protocol.rst). A device says what it answers to control requests, and hands out
// what its bulk endpoints have; a port plugs it in and out. Linux, root, one thread; messages go to standard error.
#pragma once

#include <cstdint>
#include <deque>
#include <string>
#include <vector>

namespace vm {

using Bytes = std::vector<std::uint8_t>;

// Little-endian, as everything on the bus is.
void put16(Bytes& bytes, std::uint32_t value);
void put32(Bytes& bytes, std::uint32_t value);
[[nodiscard]] Bytes usb_string(const std::string& text);  // a string descriptor

struct Setup {
    std::uint8_t type = 0, request = 0;
    std::uint16_t value = 0, index = 0, length = 0;
};

class UsbDevice {
public:
    virtual ~UsbDevice() = default;
    // What a control request reads, or, if the host writes, what it wrote; false: stalled.
    virtual bool control(const Setup& setup, const Bytes& written, Bytes& data) = 0;
    // The next bytes of a bulk endpoint, at most `most`; false: nothing yet, the request waits.
    virtual bool bulk(std::uint32_t endpoint, std::uint32_t most, Bytes& data) {
        static_cast<void>(endpoint), static_cast<void>(most), static_cast<void>(data);
        return false;
    }
};

// What every device answers: descriptors, status, configuration. False: not one of these.
struct StandardAnswers {
    Bytes device, configuration, capabilities;  // capabilities (BOS): empty if there are none
    std::vector<Bytes> strings;                 // by index
    [[nodiscard]] bool answer(const Setup& setup, Bytes& data) const;
};

enum class UsbSpeed : std::uint8_t { kHigh = 3, kSuper = 5 };  // the kernel's usb_device_speed

class UsbPort {
public:
    explicit UsbPort(UsbDevice& device) : device_(device) {}
    UsbPort(const UsbPort&) = delete;
    UsbPort& operator=(const UsbPort&) = delete;
    ~UsbPort() { unplug(); }

    [[nodiscard]] bool plug(UsbSpeed speed);  // false: the controller refused for two seconds
    void unplug();
    [[nodiscard]] bool is_plugged() const { return socket_ >= 0; }
    [[nodiscard]] int socket() const { return socket_; }  // readable when the kernel asks something
    void set_deaf(bool is_deaf) { is_deaf_ = is_deaf; }   // control requests wait for ever
    void serve_one();                                     // reads a message and answers it, or keeps it waiting
    void serve_waiting();                                 // asks the device again for what waits
    [[nodiscard]] bool has_waiting(std::uint32_t endpoint) const;

private:
    struct Waiting {
        std::uint32_t sequence = 0, endpoint = 0, length = 0;
    };

    bool submit(const std::uint32_t* words, const std::uint8_t* setup);
    bool unlink(const std::uint32_t* words);
    bool answer(std::uint32_t sequence, std::int32_t status, std::uint32_t length, const Bytes& data);

    UsbDevice& device_;
    UsbSpeed speed_ = UsbSpeed::kHigh;
    int socket_ = -1;
    bool is_deaf_ = false;
    std::deque<Waiting> waiting_;
};

}  // namespace vm
