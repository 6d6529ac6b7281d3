#include "hal/usb/usb_link.hpp"

#include <charconv>

namespace stillmesh {

const char* usb_status_name(UsbStatus status) noexcept {
    switch (status) {
        case UsbStatus::kOk: return "ok";
        case UsbStatus::kTimedOut: return "timed out";
        case UsbStatus::kGone: return "gone";
        case UsbStatus::kDenied: return "permission denied";
        case UsbStatus::kBusy: return "busy";
        case UsbStatus::kStalled: return "stalled";
        case UsbStatus::kFull: return "full";
        case UsbStatus::kUnsupported: return "unsupported";
        case UsbStatus::kFailed: return "failed";
    }
    return "unknown";
}

std::uint32_t mbit_per_s(UsbSpeed speed) noexcept {
    switch (speed) {
        case UsbSpeed::kLow: return 1;  // 1.5
        case UsbSpeed::kFull: return 12;
        case UsbSpeed::kHigh: return 480;
        case UsbSpeed::kSuper: return 5000;
        case UsbSpeed::kUnknown: break;
    }
    return 0;
}

std::string speed_text(UsbSpeed speed) {
    switch (speed) {
        case UsbSpeed::kLow: return "low speed (1.5 Mbit/s)";
        case UsbSpeed::kFull: return "full speed (12 Mbit/s)";
        case UsbSpeed::kHigh: return "high speed (480 Mbit/s)";
        case UsbSpeed::kSuper: return "super speed (5 Gbit/s or more)";
        case UsbSpeed::kUnknown: break;
    }
    return "unknown speed";
}

std::string port_text(const UsbPort& port) {
    if (port.depth == 0) return "usb" + std::to_string(port.bus);
    std::string text = std::to_string(port.bus);
    for (std::size_t i = 0; i < port.depth; ++i) text += (i == 0 ? "-" : ".") + std::to_string(port.ports[i]);
    return text;
}

bool parse_port(std::string_view text, UsbPort& port) noexcept {
    UsbPort parsed;
    const char* at = text.data();
    const char* const end = at + text.size();
    const auto number = [&](std::uint8_t& value) {
        const auto [next, error] = std::from_chars(at, end, value);
        at = next;
        return error == std::errc() && value > 0;
    };
    if (text.starts_with("usb")) {
        at += 3;
        if (!number(parsed.bus) || at != end) return false;
        port = parsed;
        return true;
    }
    if (!number(parsed.bus)) return false;
    while (at != end) {
        if (*at != (parsed.depth == 0 ? '-' : '.') || parsed.depth == UsbPort::kDepthMax) return false;
        ++at;
        if (!number(parsed.ports[parsed.depth])) return false;
        ++parsed.depth;
    }
    if (parsed.depth == 0) return false;
    port = parsed;
    return true;
}

UsbPort hub_of(const UsbPort& port) noexcept {
    UsbPort hub = port;
    if (hub.depth > 0) hub.ports[--hub.depth] = 0;
    return hub;
}

}  // namespace stillmesh
