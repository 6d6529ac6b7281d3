// A USB bus under the stock libusb: umockdev shows this process and its children a /sys and a /dev/bus/usb of our own,
// and every ioctl on a device comes here. The devices answer descriptors and control requests, know who has claimed
// them, and can stall, hang, be reset, unplugged and plugged in again. Needs libumockdev-preload in the process.
// Ioctls are served by a thread of umockdev's.
#pragma once

#include <umockdev.h>

#include <cstdint>
#include <deque>
#include <memory>
#include <mutex>
#include <string>
#include <vector>

namespace stillmesh::test {

struct EmulatedOptions {
    std::string port = "1-1";
    std::uint16_t vendor_id = 0x1d27;
    std::uint16_t product_id = 0x0601;
    std::uint8_t address = 2;
    int speed_mbit = 480;
    unsigned power_ma = 500;
    bool is_configured = true;
    bool is_self_powered = false;
    bool is_hub = false;
    std::string product = "Xtion PRO Live (emulated)";
    std::string serial = "SYN0001";
};

class EmulatedDevice {
public:
    explicit EmulatedDevice(EmulatedOptions options) : options_(std::move(options)) {}
    ~EmulatedDevice();
    EmulatedDevice(const EmulatedDevice&) = delete;
    EmulatedDevice& operator=(const EmulatedDevice&) = delete;

    // Its image endpoint has halted: reads fail until it is cleared or the device is reset.
    void halt();
    // It answers nothing any more, until it is reset.
    void hang();
    [[nodiscard]] int resets();
    [[nodiscard]] int open_now();
    // The device's file under the test's root; may be given other permissions.
    [[nodiscard]] const std::string& file() const { return file_; }

private:
    friend class EmulatedBus;
    struct Request {
        UMockdevIoctlClient* client;
        UMockdevIoctlData* urb;
        UMockdevIoctlData* bytes;
        int status;  // 1: not yet answered
    };
    static int on_ioctl(UMockdevIoctlBase*, UMockdevIoctlClient* client, void* self);
    static void on_connected(UMockdevIoctlBase*, UMockdevIoctlClient* client, void* self);
    static void on_vanished(UMockdevIoctlBase*, UMockdevIoctlClient* client, void* self);
    int serve(UMockdevIoctlClient* client);
    int reap(UMockdevIoctlClient* client, UMockdevIoctlData* argument);
    void answer(Request& request);

    EmulatedOptions options_;
    std::string folder_;  // below /sys
    std::string file_;
    UMockdevIoctlBase* ioctls_ = nullptr;
    std::mutex mutex_;  // of all below
    std::deque<Request> requests_;
    UMockdevIoctlClient* claimed_by_ = nullptr;
    bool is_halted_ = false;
    bool is_hung_ = false;
    bool is_unplugged_ = false;
    int resets_ = 0;
    int open_ = 0;
};

class EmulatedBus {
public:
    // With the root hub of bus 1.
    EmulatedBus();
    ~EmulatedBus();
    EmulatedBus(const EmulatedBus&) = delete;
    EmulatedBus& operator=(const EmulatedBus&) = delete;

    // Parents first. The kernel tells its listeners.
    EmulatedDevice& plug(const EmulatedOptions& options);
    void unplug(EmulatedDevice& device);
    // Children that run as another user may look in.
    void let_others_in();

private:
    UMockdevTestbed* testbed_;
    std::vector<std::unique_ptr<EmulatedDevice>> devices_;
};

}  // namespace stillmesh::test
