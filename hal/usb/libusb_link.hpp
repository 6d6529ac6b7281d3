// The USB bus through libusb 1.0, and what only the kernel's files know: strings without opening a device, permissions,
// drivers bound, processes that hold it (/sys/bus/usb, /dev/bus/usb, /proc). Linux. No library type crosses this
// header. A reset is the kernel's and takes as long as the device needs to come back: some 100 ms, at most 5 s.
#pragma once

#include <memory>

#include "hal/usb/usb_link.hpp"

namespace stillmesh {

class LibusbLink final : public UsbLink {
public:
    LibusbLink();
    ~LibusbLink();
    LibusbLink(const LibusbLink&) = delete;
    LibusbLink& operator=(const LibusbLink&) = delete;

    [[nodiscard]] UsbStatus enumerate(std::vector<UsbDevice>& devices) override;
    [[nodiscard]] UsbNode node(const UsbDevice& device) override;
    [[nodiscard]] std::vector<UsbHolder> holders(const UsbDevice& device) override;
    [[nodiscard]] std::string kernel_driver(const UsbDevice& device) override;
    [[nodiscard]] UsbStatus open(const UsbDevice& device, UsbHandle& handle) override;
    void close(UsbHandle handle) override;
    [[nodiscard]] UsbStatus claim(UsbHandle handle, std::uint8_t interface) override;
    [[nodiscard]] UsbStatus control_in(UsbHandle handle, std::uint8_t type, std::uint8_t request, std::uint16_t value,
                                       std::uint16_t index, std::span<std::uint8_t> data, std::size_t& count,
                                       std::uint32_t timeout_ms) override;
    [[nodiscard]] UsbStatus reset(UsbHandle handle) override;
    [[nodiscard]] UsbStatus wait_event(UsbEvent& event, std::uint32_t timeout_ms) override;

private:
    struct State;
    std::unique_ptr<State> state_;
};

}  // namespace stillmesh
