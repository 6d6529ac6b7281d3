// The port to the USB bus: who is plugged in, where, how fast, who may open it, who holds it; open, claim, ask, reset.
// Streaming is not its business (the camera drivers do that): it is for saying why a camera does not work, for hearing
// when one comes or goes, and for resetting one that is stuck. Everything above it is tested with a scripted link.
// Bodies fail a CHECK instead of being pure: see docs/decisions.md (ports without __cxa_pure_virtual).
// Limits: kOpenMax devices open at a time, kEventsMax hot-plug events kept. Every call is bounded in time.
#pragma once

#include <array>
#include <cstdint>
#include <span>
#include <string>
#include <string_view>
#include <vector>

#include "engine/base/check.hpp"

namespace stillmesh {

enum class [[nodiscard]] UsbStatus : std::uint8_t{
    kOk = 0,
    kTimedOut,     // no answer within the time allowed
    kGone,         // not plugged in (any more)
    kDenied,       // this user may not open the device's node
    kBusy,         // another process or a kernel driver has claimed it
    kStalled,      // the device refuses: an unknown request, or a halted endpoint
    kFull,         // too many devices open here, or no memory
    kUnsupported,  // not on this system
    kFailed,       // an error on the bus
};
[[nodiscard]] const char* usb_status_name(UsbStatus status) noexcept;

enum class UsbSpeed : std::uint8_t {
    kUnknown = 0,
    kLow,    // 1.5 Mbit/s
    kFull,   // 12 Mbit/s: USB 1
    kHigh,   // 480 Mbit/s: USB 2
    kSuper,  // 5 Gbit/s and more: USB 3
};
[[nodiscard]] std::uint32_t mbit_per_s(UsbSpeed speed) noexcept;
// "high speed (480 Mbit/s)"
[[nodiscard]] std::string speed_text(UsbSpeed speed);

// Where a device is plugged in: the bus and the port of every hub on the way. Stays the same when the device is reset
// or unplugged and plugged in again at the same place; bus and address do not. Written as the kernel writes it:
// "1-2.3", and "usb1" for a root hub.
struct UsbPort {
    static constexpr std::size_t kDepthMax = 7;

    std::uint8_t bus = 0;
    std::uint8_t depth = 0;  // 0: the root hub itself
    std::array<std::uint8_t, kDepthMax> ports{};

    friend bool operator==(const UsbPort&, const UsbPort&) = default;
};
[[nodiscard]] std::string port_text(const UsbPort& port);
// False: not of that form; `port` is untouched.
[[nodiscard]] bool parse_port(std::string_view text, UsbPort& port) noexcept;
// The hub it is plugged into; a root hub is its own.
[[nodiscard]] UsbPort hub_of(const UsbPort& port) noexcept;

struct UsbDevice {
    std::uint16_t vendor_id = 0;
    std::uint16_t product_id = 0;
    std::uint16_t release = 0;  // the maker's own count, binary coded decimal
    std::uint8_t device_class = 0;
    std::uint8_t address = 0;  // on its bus, until it is plugged in again
    UsbPort port;
    UsbSpeed speed = UsbSpeed::kUnknown;
    bool is_configured = false;    // else the kernel has left it off: not enough power
    bool is_self_powered = false;  // has a supply of its own
    std::uint32_t power_ma = 0;    // the most it draws from the bus
    std::uint8_t interfaces = 0;
    std::array<std::uint8_t, 8> endpoints_in{};  // of interface 0 as it is plugged in; 0: none
    std::string maker;                           // strings are empty where nobody knows them
    std::string product;
    std::string serial;
};
inline constexpr std::uint8_t kUsbClassHub = 9;

// The file that is opened to reach a device.
struct UsbNode {
    std::string path;
    bool exists = false;
    bool is_open_to_us = false;  // this user may read and write it
    std::uint32_t mode = 0;      // permission bits
    std::string group;
};

struct UsbHolder {
    std::int32_t pid = 0;
    std::string name;
};

struct UsbEvent {
    enum class Kind : std::uint8_t { kArrived, kLeft };
    Kind kind = Kind::kArrived;
    std::uint16_t vendor_id = 0;
    std::uint16_t product_id = 0;
    UsbPort port;
};

// Names an open device; zeroed, it names nothing.
struct UsbHandle {
    std::uint32_t slot_plus_one = 0;
};

class UsbLink {
public:
    static constexpr std::size_t kOpenMax = 8;
    static constexpr std::size_t kEventsMax = 16;

    // Everything on the bus, root hubs included, ordered by bus and port.
    //   kOk    kUnsupported: no USB here    kFull    kFailed
    [[nodiscard]] virtual UsbStatus enumerate(std::vector<UsbDevice>& devices) {
        static_cast<void>(devices);
        not_implemented();
    }
    [[nodiscard]] virtual UsbNode node(const UsbDevice& device) {
        static_cast<void>(device);
        not_implemented();
    }
    // Processes that have the device open, as far as this user may see them. Empty: none, or hidden.
    [[nodiscard]] virtual std::vector<UsbHolder> holders(const UsbDevice& device) {
        static_cast<void>(device);
        not_implemented();
    }
    // The kernel driver bound to interface 0; empty: none. "usbfs": a process has claimed it.
    [[nodiscard]] virtual std::string kernel_driver(const UsbDevice& device) {
        static_cast<void>(device);
        not_implemented();
    }
    //   kOk    kGone    kDenied    kFull: kOpenMax are open    kFailed
    [[nodiscard]] virtual UsbStatus open(const UsbDevice& device, UsbHandle& handle) {
        static_cast<void>(device), static_cast<void>(handle);
        not_implemented();
    }
    // Releases what is claimed.
    virtual void close(UsbHandle handle) {
        static_cast<void>(handle);
        not_implemented();
    }
    //   kOk    kBusy    kGone    kFailed
    [[nodiscard]] virtual UsbStatus claim(UsbHandle handle, std::uint8_t interface) {
        static_cast<void>(handle), static_cast<void>(interface);
        not_implemented();
    }
    // A control request that reads. `count`: bytes that came.
    //   kOk    kTimedOut    kStalled: the device does not know it    kGone    kFailed
    [[nodiscard]] virtual UsbStatus control_in(UsbHandle handle, std::uint8_t type, std::uint8_t request,
                                               std::uint16_t value, std::uint16_t index, std::span<std::uint8_t> data,
                                               std::size_t& count, std::uint32_t timeout_ms) {
        static_cast<void>(handle), static_cast<void>(type), static_cast<void>(request), static_cast<void>(value);
        static_cast<void>(index), static_cast<void>(data), static_cast<void>(count), static_cast<void>(timeout_ms);
        not_implemented();
    }
    // As if unplugged and plugged in again. The handle is closed whatever happens.
    //   kOk: the same device is back at the same place    kGone: it has come back as another, or not    kFailed
    [[nodiscard]] virtual UsbStatus reset(UsbHandle handle) {
        static_cast<void>(handle);
        not_implemented();
    }
    // The oldest event nobody has taken yet, waiting for one up to timeout_ms. Those plugged in before are no events;
    // listening begins with the first call. After kFull some were lost: enumerate again.
    //   kOk    kTimedOut: none came    kFull    kUnsupported
    [[nodiscard]] virtual UsbStatus wait_event(UsbEvent& event, std::uint32_t timeout_ms) {
        static_cast<void>(event), static_cast<void>(timeout_ms);
        not_implemented();
    }

protected:
    ~UsbLink() = default;

private:
    [[noreturn]] static void not_implemented() noexcept { check_failed("UsbLink not implemented", __FILE__, __LINE__); }
};

}  // namespace stillmesh
