#include "tests/usb/emulated_bus.hpp"

#include <linux/usbdevice_fs.h>
#include <sys/ioctl.h>
#include <sys/stat.h>

#include <algorithm>
#include <cerrno>
#include <chrono>
#include <cstddef>
#include <cstdio>
#include <cstdlib>
#include <cstring>
#include <filesystem>
#include <thread>

namespace stillmesh::test {
namespace {

using Bytes = std::vector<std::uint8_t>;

constexpr int kWaiting = 1;
constexpr std::uint8_t kImageEndpoint = 0x81;

void put16(Bytes& bytes, unsigned value) {
    bytes.push_back(static_cast<std::uint8_t>(value & 0xffU));
    bytes.push_back(static_cast<std::uint8_t>(value >> 8U));
}

// Device and configuration, as the kernel keeps them. A camera has three bulk endpoints that read.
[[nodiscard]] Bytes descriptors(const EmulatedOptions& options) {
    const bool is_usb3 = options.speed_mbit > 480;
    Bytes bytes = {18, 1};
    put16(bytes, is_usb3 ? 0x0300U : 0x0200U);
    for (const int value : {options.is_hub ? 9 : 0, 0, 0, is_usb3 ? 9 : 64}) {
        bytes.push_back(static_cast<std::uint8_t>(value));
    }
    put16(bytes, options.vendor_id);
    put16(bytes, options.product_id);
    put16(bytes, 0x0001);
    for (const int value : {2, 1, 3, 1}) bytes.push_back(static_cast<std::uint8_t>(value));
    const std::size_t endpoints = options.is_hub ? 1 : 3;
    Bytes configuration = {9, 2};
    put16(configuration, static_cast<unsigned>(9 + 9 + 7 * endpoints));
    configuration.insert(configuration.end(),
                         {1, 1, 0, static_cast<std::uint8_t>(options.is_self_powered ? 0xc0 : 0x80),
                          static_cast<std::uint8_t>(options.power_ma / (is_usb3 ? 8 : 2))});
    configuration.insert(configuration.end(), {9, 4, 0, 0, static_cast<std::uint8_t>(endpoints),
                                               static_cast<std::uint8_t>(options.is_hub ? 9 : 0xff), 0, 0, 0});
    for (std::size_t i = 0; i < endpoints; ++i) {
        configuration.insert(configuration.end(), {7, 5, static_cast<std::uint8_t>(kImageEndpoint + i),
                                                   static_cast<std::uint8_t>(options.is_hub ? 3 : 2)});
        put16(configuration, options.is_hub ? 1 : 512);
        configuration.push_back(options.is_hub ? 12 : 0);
    }
    bytes.insert(bytes.end(), configuration.begin(), configuration.end());
    return bytes;
}

[[nodiscard]] std::string hex(const Bytes& bytes) {
    std::string text;
    for (const std::uint8_t byte : bytes) {
        char digits[3];
        std::snprintf(digits, sizeof(digits), "%02X", static_cast<unsigned>(byte));
        text += digits;
    }
    return text;
}

[[nodiscard]] unsigned bus_of(const std::string& port) {
    return static_cast<unsigned>(std::strtoul(port.c_str() + (port.starts_with("usb") ? 3 : 0), nullptr, 10));
}

// The folder of a device lies in that of its hub: usb1/1-4/1-4.2.
[[nodiscard]] std::string folder_of(const std::string& port) {
    std::string folder = "/devices/pci0000:00/0000:00:14.0/usb" + std::to_string(bus_of(port));
    if (port.starts_with("usb")) return folder;
    for (std::size_t end = port.find('-'); end != std::string::npos;) {
        end = port.find('.', end + 1);
        folder += "/" + port.substr(0, end);
    }
    return folder;
}

[[nodiscard]] std::string node_of(const EmulatedOptions& options) {
    char text[32];
    std::snprintf(text, sizeof(text), "bus/usb/%03u/%03u", bus_of(options.port), unsigned{options.address});
    return text;
}

[[nodiscard]] std::string description(const EmulatedOptions& options) {
    const std::string bytes = hex(descriptors(options));
    char text[2048];
    std::snprintf(
        text, sizeof(text),
        "P: %s\nN: %s=%s\nE: BUSNUM=%03u\nE: DEVNAME=/dev/%s\nE: DEVNUM=%03u\nE: DEVTYPE=usb_device\nE: DRIVER=usb\n"
        "E: MAJOR=189\nE: MINOR=%u\nE: PRODUCT=%x/%x/1\nE: SUBSYSTEM=usb\nA: bConfigurationValue=%s\\n\nA: "
        "bDeviceClass=%s\\n\n"
        "A: bNumConfigurations=1\\n\nA: bNumInterfaces= 1\\n\nA: busnum=%u\\n\nA: devnum=%u\\n\nA: dev=189:%u\\n\n"
        "H: descriptors=%s\nA: idProduct=%04x\\n\nA: idVendor=%04x\\n\nA: product=%s\\n\nA: serial=%s\\n\nA: "
        "speed=%d\\n\n"
        "A: version= 2.00\\n\n",
        folder_of(options.port).c_str(), node_of(options).c_str(), bytes.c_str(), bus_of(options.port),
        node_of(options).c_str(), unsigned{options.address}, (bus_of(options.port) - 1) * 128U + options.address - 1U,
        unsigned{options.vendor_id}, unsigned{options.product_id}, options.is_configured ? "1" : "",
        options.is_hub ? "09" : "00", bus_of(options.port), unsigned{options.address},
        (bus_of(options.port) - 1) * 128U + options.address - 1U, bytes.c_str(), unsigned{options.product_id},
        unsigned{options.vendor_id}, options.product.c_str(), options.serial.c_str(), options.speed_mbit);
    return text;
}

void fail(const char* what, GError* error) {
    std::fprintf(stderr, "emulated bus: %s: %s\n", what, error != nullptr ? error->message : "no reason given");
    std::abort();
}

struct Unref {
    void operator()(UMockdevIoctlData* data) const { g_object_unref(data); }
};
using Data = std::unique_ptr<UMockdevIoctlData, Unref>;

// What the pointer at `offset` points to in the client's memory; written back when the ioctl is done.
[[nodiscard]] Data resolve(UMockdevIoctlData* data, std::size_t offset, std::size_t size) {
    GError* error = nullptr;
    Data resolved(umockdev_ioctl_data_resolve(data, offset, size, &error));
    if (error != nullptr) fail("ioctl data", error);
    return resolved;
}

int done(UMockdevIoctlClient* client, long result, int error) {
    umockdev_ioctl_client_complete(client, result, error);
    return 1;
}

}  // namespace

EmulatedDevice::~EmulatedDevice() {
    if (ioctls_ != nullptr) g_object_unref(ioctls_);
}

void EmulatedDevice::halt() {
    const std::lock_guard lock(mutex_);
    is_halted_ = true;
}

void EmulatedDevice::hang() {
    const std::lock_guard lock(mutex_);
    is_hung_ = true;
}

int EmulatedDevice::resets() {
    const std::lock_guard lock(mutex_);
    return resets_;
}

int EmulatedDevice::open_now() {
    const std::lock_guard lock(mutex_);
    return open_;
}

int EmulatedDevice::on_ioctl(UMockdevIoctlBase*, UMockdevIoctlClient* client, void* self) {
    return static_cast<EmulatedDevice*>(self)->serve(client);
}

void EmulatedDevice::on_connected(UMockdevIoctlBase*, UMockdevIoctlClient*, void* self) {
    EmulatedDevice& device = *static_cast<EmulatedDevice*>(self);
    const std::lock_guard lock(device.mutex_);
    ++device.open_;
}

void EmulatedDevice::on_vanished(UMockdevIoctlBase*, UMockdevIoctlClient* client, void* self) {
    EmulatedDevice& device = *static_cast<EmulatedDevice*>(self);
    const std::lock_guard lock(device.mutex_);
    --device.open_;
    if (device.claimed_by_ == client) device.claimed_by_ = nullptr;
}

int EmulatedDevice::serve(UMockdevIoctlClient* client) {
    const std::lock_guard lock(mutex_);
    const gulong request = umockdev_ioctl_client_get_request(client);
    UMockdevIoctlData* const argument = umockdev_ioctl_client_get_arg(client);
    if (is_unplugged_ && request != USBDEVFS_REAPURBNDELAY && request != USBDEVFS_DISCARDURB) {
        return done(client, -1, ENODEV);
    }
    switch (request) {
        case USBDEVFS_GET_CAPABILITIES: {
            const std::uint32_t capabilities = USBDEVFS_CAP_ZERO_PACKET | USBDEVFS_CAP_BULK_CONTINUATION |
                                               USBDEVFS_CAP_NO_PACKET_SIZE_LIM | USBDEVFS_CAP_REAP_AFTER_DISCONNECT;
            std::memcpy(resolve(argument, 0, sizeof(capabilities))->data, &capabilities, sizeof(capabilities));
            return done(client, 0, 0);
        }
        case USBDEVFS_CLAIMINTERFACE:
            if (claimed_by_ != nullptr && claimed_by_ != client) return done(client, -1, EBUSY);
            claimed_by_ = client;
            return done(client, 0, 0);
        case USBDEVFS_RELEASEINTERFACE:
            if (claimed_by_ == client) claimed_by_ = nullptr;
            return done(client, 0, 0);
        case USBDEVFS_RESET:
            ++resets_;
            is_halted_ = is_hung_ = false;
            return done(client, 0, 0);
        case USBDEVFS_CLEAR_HALT: is_halted_ = false; return done(client, 0, 0);
        case USBDEVFS_GETDRIVER:
        case USBDEVFS_IOCTL: return done(client, -1, ENODATA);  // no kernel driver is bound
        case USBDEVFS_SUBMITURB: {
            Data data = resolve(argument, 0, sizeof(usbdevfs_urb));
            const auto* const urb = reinterpret_cast<usbdevfs_urb*>(data->data);
            Data bytes;
            if (urb->buffer_length > 0) {
                const auto size = static_cast<std::size_t>(urb->buffer_length);
                bytes = resolve(data.get(), offsetof(usbdevfs_urb, buffer), size);
            }
            requests_.push_back({client, data.release(), bytes.release(), kWaiting});
            return done(client, 0, 0);
        }
        case USBDEVFS_DISCARDURB: {
            gulong address = 0;
            std::memcpy(&address, argument->data, sizeof(address));
            for (Request& waiting : requests_) {
                if (waiting.client != client || waiting.urb->client_addr != address || waiting.status != kWaiting)
                    continue;
                waiting.status = -ENOENT;
                return done(client, 0, 0);
            }
            return done(client, -1, EINVAL);
        }
        case USBDEVFS_REAPURBNDELAY: return reap(client, argument);
        default: return done(client, -1, ENOTTY);
    }
}

int EmulatedDevice::reap(UMockdevIoctlClient* client, UMockdevIoctlData* argument) {
    for (auto request = requests_.begin(); request != requests_.end(); ++request) {
        if (request->client != client) continue;
        if (is_unplugged_) request->status = -ENODEV;
        if (request->status == kWaiting && is_hung_) continue;
        auto* const urb = reinterpret_cast<usbdevfs_urb*>(request->urb->data);
        if (request->status == kWaiting) {
            answer(*request);
        } else {
            urb->status = request->status;
            urb->actual_length = 0;
        }
        const Request finished = *request;
        requests_.erase(request);
        const Data urb_kept(finished.urb);
        const Data bytes_kept(finished.bytes);
        const Data answer_to = resolve(argument, 0, sizeof(void*));
        static_cast<void>(umockdev_ioctl_data_set_ptr(answer_to.get(), 0, finished.urb));
        return done(client, 0, 0);
    }
    // The file always looks ready to poll(2): do not let the client spin too fast.
    std::this_thread::sleep_for(std::chrono::microseconds(100));
    return done(client, -1, is_unplugged_ ? ENODEV : EAGAIN);
}

void EmulatedDevice::answer(Request& request) {
    auto* const urb = reinterpret_cast<usbdevfs_urb*>(request.urb->data);
    urb->status = 0;
    urb->actual_length = 0;
    if (urb->type != USBDEVFS_URB_TYPE_CONTROL) {
        if (is_halted_) {
            urb->status = -EPIPE;
        } else {
            urb->actual_length = urb->buffer_length;
        }
        return;
    }
    std::uint8_t* const setup = request.bytes->data;
    const std::size_t length = setup[6] | static_cast<std::size_t>(setup[7]) << 8U;
    Bytes data;
    if ((setup[0] & 0xe0U) == 0x80 && setup[1] == 0) {  // GET_STATUS
        data = {static_cast<std::uint8_t>((setup[0] & 0x1fU) == 2 && is_halted_ && setup[4] == kImageEndpoint), 0};
    } else if (setup[0] == 0x80 && setup[1] == 6 && setup[3] == 1) {
        data = descriptors(options_);
    } else {
        urb->status = -EPIPE;
        return;
    }
    data.resize(std::min(data.size(), length));
    std::memcpy(setup + 8, data.data(), data.size());
    urb->actual_length = static_cast<int>(data.size());
}

EmulatedBus::EmulatedBus() : testbed_(umockdev_testbed_new()) {
    EmulatedOptions root;
    root.port = "usb1";
    root.vendor_id = 0x1d6b;
    root.product_id = 0x0002;
    root.address = 1;
    root.power_ma = 0;
    root.is_self_powered = root.is_hub = true;
    root.product = "Root hub";
    root.serial = "0000:00:14.0";
    plug(root);
}

EmulatedBus::~EmulatedBus() {
    g_object_unref(testbed_);
    devices_.clear();
}

EmulatedDevice& EmulatedBus::plug(const EmulatedOptions& options) {
    auto device = std::make_unique<EmulatedDevice>(options);
    device->folder_ = "/sys" + folder_of(options.port);
    device->ioctls_ = umockdev_ioctl_base_new();
    g_signal_connect(device->ioctls_, "handle-ioctl", G_CALLBACK(&EmulatedDevice::on_ioctl), device.get());
    g_signal_connect(device->ioctls_, "client-connected", G_CALLBACK(&EmulatedDevice::on_connected), device.get());
    g_signal_connect(device->ioctls_, "client-vanished", G_CALLBACK(&EmulatedDevice::on_vanished), device.get());
    GError* error = nullptr;
    if (umockdev_testbed_add_from_string(testbed_, description(options).c_str(), &error) == 0) fail("add", error);
    const std::string node = "/dev/" + node_of(options);
    if (umockdev_testbed_attach_ioctl(testbed_, node.c_str(), device->ioctls_, &error) == 0) fail("ioctl", error);
    gchar* const root = umockdev_testbed_get_root_dir(testbed_);
    device->file_ = root + node;
    g_free(root);
    umockdev_testbed_uevent(testbed_, device->folder_.c_str(), "add");
    devices_.push_back(std::move(device));
    return *devices_.back();
}

void EmulatedBus::unplug(EmulatedDevice& device) {
    {
        const std::lock_guard lock(device.mutex_);
        device.is_unplugged_ = true;
    }
    umockdev_testbed_uevent(testbed_, device.folder_.c_str(), "remove");
    GError* error = nullptr;
    static_cast<void>(umockdev_testbed_detach_ioctl(testbed_, ("/dev/" + node_of(device.options_)).c_str(), &error));
    g_clear_error(&error);
    umockdev_testbed_remove_device(testbed_, device.folder_.c_str());
}

void EmulatedBus::let_others_in() {
    gchar* const root = umockdev_testbed_get_root_dir(testbed_);
    namespace fs = std::filesystem;
    // umockdev's clients listen for events at sockets they make there.
    fs::permissions(root, fs::perms(0777));
    for (const fs::directory_entry& entry : fs::recursive_directory_iterator(root)) {
        if (entry.is_symlink()) continue;
        if (entry.is_directory()) fs::permissions(entry, fs::perms(0755));
        if (entry.is_socket()) fs::permissions(entry, fs::perms(0777));
    }
    g_free(root);
}

}  // namespace stillmesh::test
