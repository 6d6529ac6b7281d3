#include "hal/usb/libusb_link.hpp"

#include <dirent.h>
#include <grp.h>
#include <libusb.h>
#include <sys/stat.h>
#include <unistd.h>

#include <algorithm>
#include <cerrno>
#include <chrono>
#include <climits>
#include <cstdio>
#include <cstdlib>
#include <fstream>
#include <iterator>

namespace stillmesh {
namespace {

[[nodiscard]] UsbStatus status_of(int code) noexcept {
    switch (code) {
        case LIBUSB_SUCCESS: return UsbStatus::kOk;
        case LIBUSB_ERROR_TIMEOUT: return UsbStatus::kTimedOut;
        case LIBUSB_ERROR_NO_DEVICE:
        case LIBUSB_ERROR_NOT_FOUND: return UsbStatus::kGone;
        case LIBUSB_ERROR_ACCESS: return UsbStatus::kDenied;
        case LIBUSB_ERROR_BUSY: return UsbStatus::kBusy;
        case LIBUSB_ERROR_PIPE: return UsbStatus::kStalled;
        case LIBUSB_ERROR_NO_MEM: return UsbStatus::kFull;
        case LIBUSB_ERROR_NOT_SUPPORTED: return UsbStatus::kUnsupported;
        default: return UsbStatus::kFailed;
    }
}

[[nodiscard]] UsbSpeed speed_of(int speed) noexcept {
    switch (speed) {
        case LIBUSB_SPEED_LOW: return UsbSpeed::kLow;
        case LIBUSB_SPEED_FULL: return UsbSpeed::kFull;
        case LIBUSB_SPEED_HIGH: return UsbSpeed::kHigh;
        case LIBUSB_SPEED_UNKNOWN: return UsbSpeed::kUnknown;
        default: return speed > LIBUSB_SPEED_HIGH ? UsbSpeed::kSuper : UsbSpeed::kUnknown;
    }
}

[[nodiscard]] UsbPort port_of(libusb_device* device) noexcept {
    UsbPort port;
    port.bus = libusb_get_bus_number(device);
    const int depth = libusb_get_port_numbers(device, port.ports.data(), static_cast<int>(port.ports.size()));
    port.depth = static_cast<std::uint8_t>(std::max(depth, 0));
    // libusb fills from the end, and leaves what it moved behind.
    std::fill(port.ports.begin() + port.depth, port.ports.end(), std::uint8_t{0});
    return port;
}

// One line of a file of the kernel's; empty where there is none.
[[nodiscard]] std::string line_of(const std::string& path) {
    std::ifstream file(path);
    std::string line;
    std::getline(file, line);
    return line;
}

[[nodiscard]] std::string system_folder(const UsbPort& port) {
    return "/sys/bus/usb/devices/" + port_text(port);
}

[[nodiscard]] std::string node_path(const UsbDevice& device) {
    char path[40];
    std::snprintf(path, sizeof(path), "/dev/bus/usb/%03u/%03u", static_cast<unsigned>(device.port.bus),
                  static_cast<unsigned>(device.address));
    return path;
}

void describe_configuration(libusb_device* handle, UsbDevice& device) {
    libusb_config_descriptor* configuration = nullptr;
    device.is_configured = libusb_get_active_config_descriptor(handle, &configuration) == LIBUSB_SUCCESS;
    if (!device.is_configured && libusb_get_config_descriptor(handle, 0, &configuration) != LIBUSB_SUCCESS) return;
    // Units of 2 mA, of 8 mA from USB 3 on.
    device.power_ma = std::uint32_t{configuration->MaxPower} * (device.speed == UsbSpeed::kSuper ? 8U : 2U);
    device.is_self_powered = (configuration->bmAttributes & 0x40U) != 0;
    device.interfaces = configuration->bNumInterfaces;
    if (configuration->bNumInterfaces > 0 && configuration->interface[0].num_altsetting > 0) {
        const libusb_interface_descriptor& interface = configuration->interface[0].altsetting[0];
        std::size_t count = 0;
        for (std::uint8_t i = 0; i < interface.bNumEndpoints && count < device.endpoints_in.size(); ++i) {
            const std::uint8_t endpoint = interface.endpoint[i].bEndpointAddress;
            if ((endpoint & LIBUSB_ENDPOINT_IN) != 0) device.endpoints_in[count++] = endpoint;
        }
    }
    libusb_free_config_descriptor(configuration);
}

[[nodiscard]] UsbDevice describe(libusb_device* handle) {
    UsbDevice device;
    libusb_device_descriptor descriptor{};
    static_cast<void>(libusb_get_device_descriptor(handle, &descriptor));  // cached: does not fail
    device.vendor_id = descriptor.idVendor;
    device.product_id = descriptor.idProduct;
    device.release = descriptor.bcdDevice;
    device.device_class = descriptor.bDeviceClass;
    device.address = libusb_get_device_address(handle);
    device.port = port_of(handle);
    device.speed = speed_of(libusb_get_device_speed(handle));
    describe_configuration(handle, device);
    const std::string folder = system_folder(device.port);
    device.maker = line_of(folder + "/manufacturer");
    device.product = line_of(folder + "/product");
    device.serial = line_of(folder + "/serial");
    return device;
}

struct DeviceList {
    libusb_device** devices = nullptr;
    std::size_t count = 0;
    UsbStatus status = UsbStatus::kOk;

    explicit DeviceList(libusb_context* context) {
        const ssize_t answer = libusb_get_device_list(context, &devices);
        if (answer < 0) {
            status = status_of(static_cast<int>(answer));
        } else {
            count = static_cast<std::size_t>(answer);
        }
    }
    ~DeviceList() {
        if (devices != nullptr) libusb_free_device_list(devices, 1);
    }
    DeviceList(const DeviceList&) = delete;
    DeviceList& operator=(const DeviceList&) = delete;
};

// Whether both are the same file, by whatever name.
[[nodiscard]] bool is_same_node(const struct stat& a, const struct stat& b) noexcept {
    if (a.st_dev == b.st_dev && a.st_ino == b.st_ino) return true;
    return S_ISCHR(a.st_mode) && S_ISCHR(b.st_mode) && a.st_rdev == b.st_rdev;
}

}  // namespace

struct LibusbLink::State {
    libusb_context* context = nullptr;
    int begin_code = LIBUSB_ERROR_OTHER;
    struct Open {
        libusb_device_handle* device = nullptr;
        std::uint32_t claimed = 0;  // a bit per interface
    };
    std::array<Open, kOpenMax> open{};
    bool is_listening = false;
    libusb_hotplug_callback_handle listener = 0;
    std::array<UsbEvent, kEventsMax> events;  // a ring
    std::size_t event_first = 0;
    std::size_t event_count = 0;
    bool has_lost_events = false;

    [[nodiscard]] Open& slot(UsbHandle handle) noexcept {
        STILLMESH_CHECK(handle.slot_plus_one > 0 && handle.slot_plus_one <= kOpenMax);
        Open& slot = open[handle.slot_plus_one - 1];
        STILLMESH_CHECK(slot.device != nullptr);
        return slot;
    }
    static void close(Open& slot) noexcept {
        for (int interface = 0; slot.claimed != 0; ++interface, slot.claimed >>= 1U) {
            if ((slot.claimed & 1U) != 0) static_cast<void>(libusb_release_interface(slot.device, interface));
        }
        libusb_close(slot.device);
        slot = {};
    }
    static int LIBUSB_CALL on_event(libusb_context*, libusb_device* device, libusb_hotplug_event kind, void* self) {
        State& state = *static_cast<State*>(self);
        if (state.event_count == kEventsMax) {
            state.has_lost_events = true;
            return 0;
        }
        UsbEvent& event = state.events[(state.event_first + state.event_count) % kEventsMax];
        ++state.event_count;
        libusb_device_descriptor descriptor{};
        static_cast<void>(libusb_get_device_descriptor(device, &descriptor));
        event.kind = kind == LIBUSB_HOTPLUG_EVENT_DEVICE_ARRIVED ? UsbEvent::Kind::kArrived : UsbEvent::Kind::kLeft;
        event.vendor_id = descriptor.idVendor;
        event.product_id = descriptor.idProduct;
        event.port = port_of(device);
        return 0;
    }
};

LibusbLink::LibusbLink() : state_(std::make_unique<State>()) {
    state_->begin_code = libusb_init(&state_->context);
    if (state_->begin_code != LIBUSB_SUCCESS) state_->context = nullptr;
}

LibusbLink::~LibusbLink() {
    if (state_->context == nullptr) return;
    for (State::Open& slot : state_->open) {
        if (slot.device != nullptr) State::close(slot);
    }
    if (state_->is_listening) libusb_hotplug_deregister_callback(state_->context, state_->listener);
    libusb_exit(state_->context);
}

UsbStatus LibusbLink::enumerate(std::vector<UsbDevice>& devices) {
    devices.clear();
    // Without any USB (a container, a server) libusb says so in several ways, or shows an empty bus.
    if (state_->context == nullptr) {
        return state_->begin_code == LIBUSB_ERROR_NO_MEM ? UsbStatus::kFull : UsbStatus::kUnsupported;
    }
    if (::access("/dev/bus/usb", F_OK) != 0) return UsbStatus::kUnsupported;
    const DeviceList list(state_->context);
    if (list.status != UsbStatus::kOk) return list.status;
    for (std::size_t i = 0; i < list.count; ++i) devices.push_back(describe(list.devices[i]));
    std::sort(devices.begin(), devices.end(), [](const UsbDevice& a, const UsbDevice& b) {
        if (a.port.bus != b.port.bus) return a.port.bus < b.port.bus;
        if (a.port.ports != b.port.ports) return a.port.ports < b.port.ports;
        return a.address < b.address;
    });
    return UsbStatus::kOk;
}

UsbNode LibusbLink::node(const UsbDevice& device) {
    UsbNode node;
    node.path = node_path(device);
    struct stat facts {};
    node.exists = ::stat(node.path.c_str(), &facts) == 0;
    if (!node.exists) return node;
    node.mode = static_cast<std::uint32_t>(facts.st_mode) & 0777U;
    node.is_open_to_us = ::access(node.path.c_str(), R_OK | W_OK) == 0;
    if (const group* const entry = ::getgrgid(facts.st_gid); entry != nullptr) node.group = entry->gr_name;
    return node;
}

std::vector<UsbHolder> LibusbLink::holders(const UsbDevice& device) {
    std::vector<UsbHolder> found;
    struct stat wanted {};
    if (::stat(node_path(device).c_str(), &wanted) != 0) return found;
    const auto close_folder = [](DIR* folder) { static_cast<void>(::closedir(folder)); };
    const std::unique_ptr<DIR, decltype(close_folder)> processes(::opendir("/proc"), close_folder);
    while (const dirent* const process = processes ? ::readdir(processes.get()) : nullptr) {
        const long pid = std::strtol(process->d_name, nullptr, 10);
        if (pid <= 0 || pid > INT_MAX || pid == ::getpid()) continue;
        const std::string folder = std::string("/proc/") + process->d_name;
        const std::unique_ptr<DIR, decltype(close_folder)> files(::opendir((folder + "/fd").c_str()), close_folder);
        while (const dirent* const file = files ? ::readdir(files.get()) : nullptr) {
            struct stat facts {};
            if (::stat((folder + "/fd/" + file->d_name).c_str(), &facts) != 0 || !is_same_node(facts, wanted)) continue;
            found.push_back({static_cast<std::int32_t>(pid), line_of(folder + "/comm")});
            break;
        }
    }
    std::sort(found.begin(), found.end(), [](const UsbHolder& a, const UsbHolder& b) { return a.pid < b.pid; });
    return found;
}

std::string LibusbLink::kernel_driver(const UsbDevice& device) {
    const std::string link = system_folder(device.port) + "/" + port_text(device.port) + ":1.0/driver";
    char target[256];
    const ssize_t length = ::readlink(link.c_str(), target, sizeof(target));
    if (length <= 0) return {};
    const std::string path(target, static_cast<std::size_t>(length));
    return path.substr(path.rfind('/') + 1);
}

UsbStatus LibusbLink::open(const UsbDevice& device, UsbHandle& handle) {
    if (state_->context == nullptr) return UsbStatus::kUnsupported;
    const auto free = std::find_if(state_->open.begin(), state_->open.end(),
                                   [](const State::Open& slot) { return slot.device == nullptr; });
    if (free == state_->open.end()) return UsbStatus::kFull;
    const DeviceList list(state_->context);
    if (list.status != UsbStatus::kOk) return list.status;
    for (std::size_t i = 0; i < list.count; ++i) {
        if (libusb_get_bus_number(list.devices[i]) != device.port.bus ||
            libusb_get_device_address(list.devices[i]) != device.address) {
            continue;
        }
        const int code = libusb_open(list.devices[i], &free->device);
        if (code != LIBUSB_SUCCESS) {
            free->device = nullptr;
            return status_of(code);
        }
        handle.slot_plus_one = static_cast<std::uint32_t>(std::distance(state_->open.begin(), free)) + 1;
        return UsbStatus::kOk;
    }
    return UsbStatus::kGone;
}

void LibusbLink::close(UsbHandle handle) {
    State::close(state_->slot(handle));
}

UsbStatus LibusbLink::claim(UsbHandle handle, std::uint8_t interface) {
    STILLMESH_CHECK(interface < 32);
    State::Open& slot = state_->slot(handle);
    const int code = libusb_claim_interface(slot.device, interface);
    if (code == LIBUSB_SUCCESS) slot.claimed |= 1U << interface;
    return status_of(code);
}

UsbStatus LibusbLink::control_in(UsbHandle handle, std::uint8_t type, std::uint8_t request, std::uint16_t value,
                                 std::uint16_t index, std::span<std::uint8_t> data, std::size_t& count,
                                 std::uint32_t timeout_ms) {
    STILLMESH_CHECK(data.size() <= UINT16_MAX && timeout_ms > 0);  // 0 would mean for ever
    count = 0;
    const int code = libusb_control_transfer(state_->slot(handle).device,
                                             static_cast<std::uint8_t>(type | LIBUSB_ENDPOINT_IN), request, value,
                                             index, data.data(), static_cast<std::uint16_t>(data.size()), timeout_ms);
    if (code < 0) return status_of(code);
    count = static_cast<std::size_t>(code);
    return UsbStatus::kOk;
}

UsbStatus LibusbLink::reset(UsbHandle handle) {
    State::Open& slot = state_->slot(handle);
    const int code = libusb_reset_device(slot.device);
    State::close(slot);
    return status_of(code);
}

UsbStatus LibusbLink::wait_event(UsbEvent& event, std::uint32_t timeout_ms) {
    if (state_->context == nullptr || libusb_has_capability(LIBUSB_CAP_HAS_HOTPLUG) == 0)
        return UsbStatus::kUnsupported;
    if (!state_->is_listening) {
        const int code = libusb_hotplug_register_callback(
            state_->context, LIBUSB_HOTPLUG_EVENT_DEVICE_ARRIVED | LIBUSB_HOTPLUG_EVENT_DEVICE_LEFT,
            LIBUSB_HOTPLUG_NO_FLAGS, LIBUSB_HOTPLUG_MATCH_ANY, LIBUSB_HOTPLUG_MATCH_ANY, LIBUSB_HOTPLUG_MATCH_ANY,
            &State::on_event, state_.get(), &state_->listener);
        if (code != LIBUSB_SUCCESS) return status_of(code);
        state_->is_listening = true;
    }
    using Clock = std::chrono::steady_clock;
    const Clock::time_point until = Clock::now() + std::chrono::milliseconds(timeout_ms);
    for (;;) {
        const auto left = std::chrono::duration_cast<std::chrono::microseconds>(until - Clock::now()).count();
        timeval wait{};
        if (state_->event_count == 0 && left > 0) {
            wait.tv_sec = static_cast<decltype(wait.tv_sec)>(left / 1'000'000);
            wait.tv_usec = static_cast<decltype(wait.tv_usec)>(left % 1'000'000);
        }
        static_cast<void>(libusb_handle_events_timeout_completed(state_->context, &wait, nullptr));
        if (state_->has_lost_events) {
            state_->has_lost_events = false;
            state_->event_count = 0;
            return UsbStatus::kFull;
        }
        if (state_->event_count > 0) {
            event = state_->events[state_->event_first];
            state_->event_first = (state_->event_first + 1) % kEventsMax;
            --state_->event_count;
            return UsbStatus::kOk;
        }
        if (left <= 0) return UsbStatus::kTimedOut;
    }
}

}  // namespace stillmesh
