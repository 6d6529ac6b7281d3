// A USB bus as a test writes it: devices with their faults, and a log of what was done to them.
#pragma once

#include <algorithm>
#include <cstdint>
#include <deque>
#include <string>
#include <vector>

#include "hal/usb/usb_link.hpp"

namespace stillmesh::test {

struct ScriptedDevice {
    UsbDevice device;
    UsbNode node{"", true, true, 0664, "root"};
    UsbStatus open = UsbStatus::kOk;
    UsbStatus claim = UsbStatus::kOk;
    UsbStatus answer = UsbStatus::kOk;  // to control requests
    UsbStatus reset = UsbStatus::kOk;
    bool is_halted = false;
    std::string driver;
    std::vector<UsbHolder> holders;
};

class ScriptedUsbLink final : public UsbLink {
public:
    std::vector<ScriptedDevice> devices;
    UsbStatus bus = UsbStatus::kOk;
    std::deque<UsbEvent> events;
    std::vector<std::string> log;
    int open_now = 0;

    // A device at `port`, fit to stream.
    ScriptedDevice& plug(std::uint16_t vendor_id, std::uint16_t product_id, const char* port) {
        ScriptedDevice made;
        made.device.vendor_id = vendor_id;
        made.device.product_id = product_id;
        STILLMESH_CHECK(parse_port(port, made.device.port));
        made.device.address = static_cast<std::uint8_t>(devices.size() + 2);
        made.device.speed = UsbSpeed::kHigh;
        made.device.is_configured = true;
        made.device.power_ma = 500;
        made.device.interfaces = 1;
        made.device.endpoints_in = {0x81, 0x82};
        made.node.path = "/dev/bus/usb/of/" + std::string(port);
        devices.push_back(made);
        return devices.back();
    }
    ScriptedDevice& plug_hub(const char* port, UsbSpeed speed, bool is_self_powered) {
        ScriptedDevice& hub = plug(0x1d6b, 0x0002, port);
        hub.device.device_class = kUsbClassHub;
        hub.device.speed = speed;
        hub.device.is_self_powered = is_self_powered;
        return hub;
    }

    UsbStatus enumerate(std::vector<UsbDevice>& found) override {
        found.clear();
        for (const ScriptedDevice& scripted : devices) found.push_back(scripted.device);
        return bus;
    }
    UsbNode node(const UsbDevice& device) override { return at(device).node; }
    std::vector<UsbHolder> holders(const UsbDevice& device) override { return at(device).holders; }
    std::string kernel_driver(const UsbDevice& device) override { return at(device).driver; }
    UsbStatus open(const UsbDevice& device, UsbHandle& handle) override {
        ScriptedDevice& scripted = at(device);
        log.push_back("open " + port_text(device.port));
        if (scripted.open != UsbStatus::kOk) return scripted.open;
        handle.slot_plus_one = static_cast<std::uint32_t>(&scripted - devices.data()) + 1;
        ++open_now;
        return UsbStatus::kOk;
    }
    void close(UsbHandle handle) override {
        log.push_back("close " + port_text(at(handle).device.port));
        --open_now;
    }
    UsbStatus claim(UsbHandle handle, std::uint8_t) override {
        log.push_back("claim " + port_text(at(handle).device.port));
        return at(handle).claim;
    }
    UsbStatus control_in(UsbHandle handle, std::uint8_t type, std::uint8_t, std::uint16_t, std::uint16_t,
                         std::span<std::uint8_t> data, std::size_t& count, std::uint32_t) override {
        std::fill(data.begin(), data.end(), std::uint8_t{0});
        count = data.size();
        if (type == 0x82 && at(handle).is_halted) data[0] = 1;
        return at(handle).answer;
    }
    UsbStatus reset(UsbHandle handle) override {
        log.push_back("reset " + port_text(at(handle).device.port));
        --open_now;
        return at(handle).reset;
    }
    UsbStatus wait_event(UsbEvent& event, std::uint32_t) override {
        if (events.empty()) return UsbStatus::kTimedOut;
        event = events.front();
        events.pop_front();
        return UsbStatus::kOk;
    }

private:
    ScriptedDevice& at(const UsbDevice& device) {
        const auto found = std::find_if(devices.begin(), devices.end(), [&](const ScriptedDevice& scripted) {
            return scripted.device.port == device.port;
        });
        STILLMESH_CHECK(found != devices.end());
        return *found;
    }
    ScriptedDevice& at(UsbHandle handle) { return devices.at(handle.slot_plus_one - 1); }
};

}  // namespace stillmesh::test
