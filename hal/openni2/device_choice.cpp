#include "hal/openni2/device_choice.hpp"

#include <algorithm>
#include <cerrno>
#include <cstdio>
#include <cstring>
#include <filesystem>
#include <string_view>
#include <system_error>
#include <utility>
#include <vector>

namespace stillmesh::openni2 {
namespace {

// Why a file is none that OpenNI2 could play; empty: it may.
[[nodiscard]] std::string why_no_recording(const std::string& name) {
    std::error_code ignored;
    // A pipe would be waited for, and a socket or device is nothing that could be played.
    if (std::filesystem::exists(name, ignored) && !std::filesystem::is_regular_file(name, ignored)) {
        return "is no regular file.";
    }
    errno = 0;
    std::FILE* const file = std::fopen(name.c_str(), "rb");
    char magic[4] = {};
    const bool is_long_enough = file != nullptr && std::fread(magic, 1, sizeof(magic), file) == sizeof(magic);
    const int error = errno;
    if (file != nullptr) static_cast<void>(std::fclose(file));
    if (error == ENOENT) return "there is no such file.";
    if (error != 0) return std::string("cannot be read: ") + std::strerror(error) + ".";
    if (!is_long_enough) return "is empty.";
    return std::memcmp(magic, "NI10", sizeof(magic)) == 0 ? std::string()
                                                          : "is no .oni recording (it does not begin with NI10).";
}

[[nodiscard]] DeviceChoice refuse(Status status, std::string message) {
    return {.status = status, .message = std::move(message)};
}

// Maker and product: what comes before bus and address in "1d27/0601@1/5".
[[nodiscard]] std::string kind_of(const std::string& uri) {
    return uri.substr(0, uri.find('@'));
}

// Empty: it does not say.
[[nodiscard]] std::string serial_of(openni::Device& device) {
    char serial[128] = {};
    int size = sizeof(serial) - 1;
    const bool does_say = device.getProperty(openni::DEVICE_PROPERTY_SERIAL_NUMBER, serial, &size) == openni::STATUS_OK;
    return does_say ? serial : std::string();
}

}  // namespace

bool names_file(const std::string& device) {
    constexpr std::string_view kEnding = ".oni";
    std::error_code error;
    return (device.size() > kEnding.size() &&
            std::equal(kEnding.begin(), kEnding.end(), device.end() - static_cast<std::ptrdiff_t>(kEnding.size()),
                       [](char a, char b) { return a == b || (b >= 'A' && b <= 'Z' && a == b + ('a' - 'A')); })) ||
           std::filesystem::is_regular_file(device, error);
}

DeviceChoice open_recording(const std::string& file, openni::Device& device) {
    if (const std::string why = why_no_recording(file); !why.empty())
        return refuse(Status::kInvalid, file + ": " + why);
    if (device.open(file.c_str()) != openni::STATUS_OK || !device.isFile()) {
        return refuse(Status::kInvalid,
                      file + ": OpenNI2 cannot play it (" + extended_error() + "); was its recording cut off?");
    }
    return {.status = Status::kOk, .description = file};
}

DeviceChoice open_camera(Runtime& runtime, const std::string& wanted_first, const DeviceIdentity& known,
                         openni::Device& device) {
    std::vector<DeviceName> devices = runtime.devices();
    std::string wanted = wanted_first;
    if (!known.uri.empty()) {
        std::erase_if(devices, [&known](const DeviceName& name) { return kind_of(name.uri) != kind_of(known.uri); });
        const auto same = std::stable_partition(devices.begin(), devices.end(),
                                                [&known](const DeviceName& name) { return name.uri == known.uri; });
        const bool has_moved = same == devices.begin();
        wanted = !known.serial.empty()              ? known.serial
                 : has_moved && devices.size() == 1 ? devices.front().uri
                                                    : known.uri;
    }
    const bool is_any = wanted.empty() || wanted == "auto";
    const bool is_uri =
        std::any_of(devices.begin(), devices.end(), [&wanted](const DeviceName& name) { return name.uri == wanted; });
    std::string seen;
    std::string failure;
    for (const DeviceName& name : devices) {
        if (is_uri && name.uri != wanted) continue;  // to open another one for its serial number may disturb it
        seen += (seen.empty() ? " " : ", ") + name.uri;
        if (device.open(name.uri.c_str()) != openni::STATUS_OK) {
            if (is_any || wanted == name.uri) failure = name.uri + " cannot be opened: " + extended_error();
            continue;
        }
        const std::string serial = serial_of(device);
        if (is_any || wanted == name.uri || (!serial.empty() && wanted == serial)) {
            return {.status = Status::kOk,
                    .description = name.vendor + " " + name.name + ", " + name.uri +
                                   (serial.empty() ? std::string() : ", serial " + serial),
                    .identity = {.uri = name.uri, .serial = serial}};
        }
        if (!serial.empty()) seen += " (serial " + serial + ")";
        device.close();
    }
    if (!failure.empty()) {
        return refuse(Status::kUnavailable, failure + "; 'stillmesh cameras' says what keeps it from working.");
    }
    if (devices.empty()) {
        return refuse(Status::kUnavailable,
                      "no camera is plugged in that OpenNI2 knows; 'stillmesh cameras' says what is, and what to do.");
    }
    return refuse(Status::kUnavailable,
                  "no camera has the URI or serial number '" + wanted + "'; there are:" + seen + ".");
}

}  // namespace stillmesh::openni2
