#include "hal/v4l2/sysfs_nodes.hpp"

#include <algorithm>
#include <charconv>
#include <filesystem>
#include <fstream>
#include <utility>

namespace stillmesh::v4l2 {
namespace {

namespace fs = std::filesystem;

[[nodiscard]] std::string line_of(const fs::path& file) {
    std::ifstream stream(file);
    std::string line;
    std::getline(stream, line);
    while (!line.empty() && (line.back() == ' ' || line.back() == '\r')) line.pop_back();
    return line;
}

[[nodiscard]] std::uint32_t number_of(const fs::path& file, int base) {
    const std::string line = line_of(file);
    std::uint32_t number = 0;
    static_cast<void>(std::from_chars(line.data(), line.data() + line.size(), number, base));
    return number;
}

}  // namespace

std::vector<V4l2Node> nodes_of_sysfs(const std::string& root, const std::string& devices) {
    std::vector<std::pair<std::uint32_t, V4l2Node>> numbered;
    std::error_code error;
    for (fs::directory_iterator at(root + "/class/video4linux", error), end; !error && at != end; at.increment(error)) {
        const std::string name = at->path().filename().string();
        std::uint32_t number = 0;
        constexpr std::string_view kVideo = "video";
        if (!name.starts_with(kVideo)) continue;
        const char* const last = name.data() + name.size();
        if (std::from_chars(name.data() + kVideo.size(), last, number).ptr != last) continue;
        V4l2Node node;
        node.path = devices + "/" + name;
        // The node's device is an interface, its folder lies in that of the USB device.
        std::error_code gone;
        const fs::path interface = fs::canonical(at->path() / "device", gone);
        const fs::path usb = interface.parent_path();
        if (!gone && fs::exists(interface / "bInterfaceNumber", gone) && fs::exists(usb / "idVendor", gone)) {
            node.usb_port = usb.filename().string();
            node.serial = line_of(usb / "serial");
            node.product = line_of(usb / "product");
            node.vendor_id = static_cast<std::uint16_t>(number_of(usb / "idVendor", 16));
            node.product_id = static_cast<std::uint16_t>(number_of(usb / "idProduct", 16));
            node.interface = static_cast<std::uint8_t>(number_of(interface / "bInterfaceNumber", 16));
            node.speed_mbit_per_s = number_of(usb / "speed", 10);
        }
        numbered.emplace_back(number, std::move(node));
    }
    std::sort(numbered.begin(), numbered.end(), [](const auto& a, const auto& b) { return a.first < b.first; });
    std::vector<V4l2Node> nodes;
    nodes.reserve(numbered.size());
    for (auto& [number, node] : numbered) nodes.push_back(std::move(node));
    return nodes;
}

}  // namespace stillmesh::v4l2
