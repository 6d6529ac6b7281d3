#include "hal/openni2/device_choice.hpp"

#include <algorithm>
#include <cerrno>
#include <cstdio>
#include <cstring>
#include <filesystem>
#include <string_view>
#include <utility>

namespace stillmesh::openni2 {
namespace {

// Why a file is none that OpenNI2 could play; empty: it may.
[[nodiscard]] std::string why_no_recording(const std::string& name) {
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

}  // namespace

bool names_file(const std::string& device) {
    constexpr std::string_view kEnding = ".oni";
    std::error_code error;
    return (device.size() > kEnding.size() &&
            std::equal(kEnding.begin(), kEnding.end(), device.end() - static_cast<std::ptrdiff_t>(kEnding.size()),
                       [](char a, char b) { return a == b || (b >= 'A' && b <= 'Z' && a == b + ('a' - 'A')); })) ||
           std::filesystem::is_regular_file(device, error);
}

std::string extended_error() {
    std::string text = openni::OpenNI::getExtendedError();
    while (!text.empty() && (text.back() == '\n' || text.back() == ' ' || text.back() == '\t')) text.pop_back();
    for (char& c : text) {
        if (c == '\n' || c == '\t') c = ' ';
    }
    text.erase(0, text.find_first_not_of(' '));
    return text.empty() ? "OpenNI2 does not say why" : text;
}

DeviceChoice open_device(Runtime& runtime, const std::string& wanted, bool is_file, openni::Device& device) {
    const auto refuse = [](Status status, std::string message) {
        return DeviceChoice{.status = status, .message = std::move(message), .description = {}, .uri = {}};
    };
    if (is_file) {
        if (const std::string why = why_no_recording(wanted); !why.empty()) {
            return refuse(Status::kInvalid, wanted + ": " + why);
        }
        if (device.open(wanted.c_str()) != openni::STATUS_OK || !device.isFile()) {
            return refuse(Status::kInvalid,
                          wanted + ": OpenNI2 cannot play it (" + extended_error() + "); was its recording cut off?");
        }
        return {.status = Status::kOk, .message = {}, .description = wanted, .uri = {}};
    }
    const std::vector<DeviceName> devices = runtime.devices();
    std::string seen;
    std::string failure;
    const bool is_uri =
        std::any_of(devices.begin(), devices.end(), [&wanted](const DeviceName& name) { return name.uri == wanted; });
    for (const DeviceName& name : devices) {
        if (is_uri && name.uri != wanted) continue;  // to open another one for its serial number may disturb it
        seen += (seen.empty() ? " " : ", ") + name.uri;
        const bool is_any = wanted.empty() || wanted == "auto";
        if (device.open(name.uri.c_str()) != openni::STATUS_OK) {
            if (is_any || wanted == name.uri) failure = name.uri + " cannot be opened: " + extended_error();
            continue;
        }
        char serial[128] = {};
        int size = sizeof(serial) - 1;
        if (device.getProperty(openni::DEVICE_PROPERTY_SERIAL_NUMBER, serial, &size) != openni::STATUS_OK)
            serial[0] = 0;
        if (is_any || wanted == name.uri || (serial[0] != 0 && wanted == serial)) {
            std::string description = name.vendor + " " + name.name + ", " + name.uri;
            if (serial[0] != 0) description += std::string(", serial ") + serial;
            return {.status = Status::kOk, .message = {}, .description = std::move(description), .uri = name.uri};
        }
        if (serial[0] != 0) seen += std::string(" (serial ") + serial + ")";
        device.close();
    }
    if (!failure.empty()) {
        return refuse(Status::kUnavailable, failure + "; 'stillmesh cameras' says what keeps it from working.");
    }
    if (devices.empty())
        return refuse(Status::kUnavailable,
                      "no camera is plugged in that OpenNI2 knows; 'stillmesh cameras' says what is, and what to do.");
    return refuse(Status::kUnavailable,
                  "no camera has the URI or serial number '" + wanted + "'; there are:" + seen + ".");
}

}  // namespace stillmesh::openni2
