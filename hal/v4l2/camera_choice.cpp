#include "hal/v4l2/camera_choice.hpp"

#include <algorithm>
#include <cerrno>
#include <cstdio>
#include <cstring>

#include "hal/v4l2/pixel_formats.hpp"
#include "hal/v4l2/realsense_device.hpp"
#include "hal/v4l2/realsense_tables.hpp"

namespace stillmesh::v4l2 {
namespace {

constexpr const char* kAskWhat = "'stillmesh cameras' says more";

// The nodes of one USB device.
struct Device {
    V4l2Node first;
    std::vector<AskedNode> nodes;
};

// The best node of a device for either: RealSense's infrared node offers grey and YUV too, so that colour formats
// count.
[[nodiscard]] const AskedNode* depth_node(const Device& device) {
    const auto found = std::find_if(device.nodes.begin(), device.nodes.end(), has_depth);
    return found == device.nodes.end() ? nullptr : &*found;
}
[[nodiscard]] int colour_rank(const AskedNode& node) {
    int best = 0;
    for (const Mode& mode : node.modes) {
        const bool is_true_colour = mode.fourcc == kYuyv || mode.fourcc == kRgb3 || mode.fourcc == kMjpg;
        best = std::max(best, is_true_colour ? 3 : mode.fourcc == kUyvy ? 2 : is_colour(mode.fourcc) ? 1 : 0);
    }
    return best;
}
[[nodiscard]] bool has_grey(const AskedNode& node) {
    return std::any_of(node.modes.begin(), node.modes.end(), [](const Mode& mode) { return mode.fourcc == kGrey; });
}
[[nodiscard]] bool is_realsense(const V4l2Node& node) {
    return realsense_name(node.vendor_id, node.product_id) != nullptr;
}
[[nodiscard]] const AskedNode* colour_node(const Device& device, const AskedNode* depth, bool is_infrared) {
    const AskedNode* best = nullptr;
    for (const AskedNode& node : device.nodes) {
        // A node streams one format at a time.
        if (&node == depth || colour_rank(node) == 0 || (is_infrared && !has_grey(node))) continue;
        if (best == nullptr || colour_rank(node) > colour_rank(*best)) best = &node;
    }
    return best;
}

// Whether the camera opened before can be this device: by its serial number, else by its place, else as the only one of
// its kind.
[[nodiscard]] bool is_known(const V4l2Node& node, const Identity& known, const std::vector<V4l2Node>& all) {
    if (node.vendor_id != known.vendor_id || node.product_id != known.product_id) return false;
    if (!known.serial.empty() || !node.serial.empty()) return node.serial == known.serial;
    const bool is_alone = std::all_of(all.begin(), all.end(), [&](const V4l2Node& other) {
        return other.vendor_id != node.vendor_id || other.product_id != node.product_id ||
               other.usb_port == node.usb_port;
    });
    return node.usb_port == known.usb_port || is_alone;
}

[[nodiscard]] CameraChoice refused(Status status, std::string why) {
    CameraChoice choice;
    choice.status = status;
    choice.message = std::move(why);
    return choice;
}

[[nodiscard]] CameraChoice chosen(AskedNode depth, AskedNode colour) {
    CameraChoice choice;
    for (const AskedNode* node : {&depth, &colour}) {
        if (node->error != 0) return refused(Status::kUnavailable, why_not(node->node.path, node->error));
    }
    choice.status = Status::kOk;
    choice.depth = std::move(depth);
    choice.colour = std::move(colour);
    return choice;
}

[[nodiscard]] V4l2Node node_called(const std::vector<V4l2Node>& nodes, const std::string& path) {
    const auto found =
        std::find_if(nodes.begin(), nodes.end(), [&](const V4l2Node& node) { return node.path == path; });
    V4l2Node alone;
    alone.path = path;
    return found == nodes.end() ? alone : *found;
}

[[nodiscard]] CameraChoice choose_named(V4l2Link& link, const std::vector<V4l2Node>& nodes, const std::string& wanted) {
    const std::size_t comma = wanted.find(',');
    const std::string depth_path = wanted.substr(0, comma), colour_path = wanted.substr(comma + 1);
    if (depth_path.empty() || colour_path.empty() || depth_path == colour_path) {
        return refused(Status::kInvalid, "v4l2:" + wanted +
                                             ": name two nodes, the one with depth first, such as "
                                             "v4l2:/dev/video0,/dev/video4.");
    }
    CameraChoice choice =
        chosen(ask_node(link, node_called(nodes, depth_path)), ask_node(link, node_called(nodes, colour_path)));
    if (choice.status != Status::kOk) return choice;
    if (!has_depth(choice.depth)) {
        return refused(Status::kInvalid, depth_path + ": has no depth images (Z16 or Y16); " + kAskWhat + ".");
    }
    if (!has_colour(choice.colour)) {
        return refused(Status::kInvalid, colour_path + ": has no images in a format that is understood (" +
                                             "YUYV, UYVY, RGB3, MJPG, GREY, Y8I); " + kAskWhat + ".");
    }
    return choice;
}

// The camera of before, whatever its nodes are called now.
[[nodiscard]] CameraChoice choose_known(V4l2Link& link, const std::vector<V4l2Node>& nodes, const Identity& known) {
    std::vector<AskedNode> depth, colour;
    for (const V4l2Node& node : nodes) {
        const bool is_of_camera = known.vendor_id != 0
                                      ? is_known(node, known, nodes)
                                      : node.path == known.depth_path || node.path == known.colour_path;
        if (!is_of_camera) continue;
        AskedNode asked = ask_node(link, node);
        // A metadata node has its camera's interface.
        if (asked.error == 0 && !asked.is_capture) continue;
        const bool is_depth_node = known.vendor_id != 0 ? node.interface == known.depth_interface && has_depth(asked)
                                                        : node.path == known.depth_path;
        const bool is_colour_node =
            known.vendor_id != 0 ? node.interface == known.colour_interface : node.path == known.colour_path;
        if (asked.error != 0) return refused(Status::kUnavailable, why_not(node.path, asked.error));
        if (is_depth_node && depth.empty()) {
            depth.push_back(std::move(asked));
        } else if (is_colour_node && has_colour(asked) && colour.empty()) {
            colour.push_back(std::move(asked));
        }
    }
    if (depth.empty() || colour.empty()) {
        return refused(Status::kUnavailable, "the camera of before is not plugged in; it is waited for.");
    }
    return chosen(std::move(depth.front()), std::move(colour.front()));
}

// By what the USB device calls itself, or by what is written on a RealSense.
[[nodiscard]] bool has_serial(V4l2Link& link, const V4l2Node& node, const std::string& serial) {
    if (node.serial == serial) return true;
    if (realsense_name(node.vendor_id, node.product_id) == nullptr) return false;
    int handle = -1;
    if (link.open(node.path, handle) != 0) return false;
    RealSenseDevice device(link, handle);
    DeviceDetails details;
    std::string message;
    const bool is_same = device.read_details(details, message) == Status::kOk && details.serial == serial;
    link.close(handle);
    return is_same;
}

[[nodiscard]] CameraChoice choose_first(V4l2Link& link, const std::vector<V4l2Node>& nodes, const std::string& serial,
                                        bool is_infrared) {
    std::string seen, last;
    for (auto first = nodes.begin(); first != nodes.end(); ++first) {
        const auto is_sibling = [&first](const V4l2Node& node) { return node.usb_port == first->usb_port; };
        // What is no USB device is used when it is named.
        if (first->usb_port.empty() || (is_infrared && !is_realsense(*first)) ||
            std::any_of(nodes.begin(), first, is_sibling))
            continue;
        Device device{*first, {}};
        if (!serial.empty() && !has_serial(link, device.first, serial)) {
            seen += (seen.empty() ? "" : "; ") + camera_text(device.first);
            continue;
        }
        for (const V4l2Node& node : nodes) {
            if (is_sibling(node)) device.nodes.push_back(ask_node(link, node));
        }
        const AskedNode* const depth = depth_node(device);
        const AskedNode* const colour = colour_node(device, depth, is_infrared);
        if (depth != nullptr && colour != nullptr) return chosen(*depth, *colour);
        const auto failed =
            std::find_if(device.nodes.begin(), device.nodes.end(), [](const AskedNode& n) { return n.error != 0; });
        // Somebody's webcam that cannot be opened is no news, unless it was asked for.
        const bool may_be_it =
            !serial.empty() || realsense_name(device.first.vendor_id, device.first.product_id) != nullptr;
        if (may_be_it && failed != device.nodes.end()) {
            last = camera_text(device.first) + ": " + why_not(failed->node.path, failed->error);
        } else if (may_be_it || depth != nullptr) {
            last = camera_text(device.first) + ": has no " +
                   (depth == nullptr ? "depth"
                    : is_infrared    ? "infrared"
                                     : "colour") +
                   " images; both are needed.";
        } else {
            seen += (seen.empty() ? "" : "; ") + camera_text(device.first);
        }
    }
    if (!last.empty()) return refused(Status::kUnavailable, last);
    return refused(Status::kUnavailable, "no depth camera of the USB Video Class" +
                                             (serial.empty() ? std::string() : " with serial number " + serial) +
                                             " is plugged in" + (seen.empty() ? "" : " (there is: " + seen + ")") +
                                             (nodes.empty() ? ", or the kernel's driver uvcvideo is not loaded" : "") +
                                             "; " + kAskWhat + ".");
}

// uvcvideo registers a node of metadata behind each of images. What it carries is asked when it is opened.
[[nodiscard]] std::string metadata_path(const std::vector<V4l2Node>& nodes, const AskedNode& images) {
    if (!is_realsense(images.node)) return {};
    auto node = std::find_if(nodes.begin(), nodes.end(),
                             [&images](const V4l2Node& one) { return one.path == images.node.path; });
    if (node != nodes.end()) ++node;
    const bool is_beside =
        node != nodes.end() && node->usb_port == images.node.usb_port && node->interface == images.node.interface;
    return is_beside ? node->path : std::string();
}

}  // namespace

AskedNode ask_node(V4l2Link& link, const V4l2Node& node) {
    AskedNode asked;
    asked.node = node;
    int handle = -1;
    asked.error = link.open(node.path, handle);
    if (asked.error != 0) return asked;
    std::uint32_t capabilities = 0;
    asked.error = link.query_capability(handle, capabilities);
    asked.is_capture = asked.error == 0 && (capabilities & kV4l2Capture) != 0 && (capabilities & kV4l2Streaming) != 0;
    if (asked.is_capture) asked.error = list_modes(link, handle, asked.modes);
    link.close(handle);
    return asked;
}

bool has_depth(const AskedNode& node) noexcept {
    const bool is_realsense = realsense_name(node.node.vendor_id, node.node.product_id) != nullptr;
    return std::any_of(node.modes.begin(), node.modes.end(), [is_realsense](const Mode& mode) {
        return mode.fourcc == kZ16 || (mode.fourcc == kY16 && !is_realsense);
    });
}

bool has_colour(const AskedNode& node) noexcept {
    return colour_rank(node) > 0;
}

std::string why_not(const std::string& path, int error) {
    switch (error) {
        case EACCES:
        case EPERM:
            return "this user may not open " + path +
                   ": join the group video (sudo usermod -aG video \"$USER\"), then log out and in again.";
        case ENOENT: return "there is no " + path + "; " + kAskWhat + ".";
        case ENODEV:
        case ENXIO: return path + ": is unplugged.";
        case EBUSY: return path + ": another program streams from it; end that first.";
        case ENOSPC: return path + ": the USB bus has no room for it; plug the camera into a port of its own.";
        default: return path + ": does not answer as a camera does (" + std::strerror(error) + "); " + kAskWhat + ".";
    }
}

std::string camera_text(const V4l2Node& node) {
    const char* const known = realsense_name(node.vendor_id, node.product_id);
    std::string text = known != nullptr ? known : node.product.empty() ? node.path : node.product;
    if (node.vendor_id != 0) {
        char ids[16];
        std::snprintf(ids, sizeof(ids), " (%04x:%04x)", static_cast<unsigned>(node.vendor_id),
                      static_cast<unsigned>(node.product_id));
        text += ids;
    }
    return node.serial.empty() ? text : text + ", serial " + node.serial;
}

CameraChoice choose_camera(V4l2Link& link, const std::string& wanted, const Identity& known) {
    const std::vector<V4l2Node> nodes = link.nodes();
    CameraChoice choice;
    const std::string word = wanted.substr(wanted.rfind(',') + 1);  // all of it, where there is no comma
    const bool is_alternating = word == "alternate", is_infrared = word == "ir" || is_alternating;
    if (known.is_known()) {
        choice = choose_known(link, nodes, known);
        choice.is_infrared = known.is_infrared;
        choice.is_alternating = known.is_alternating;
    } else if (is_infrared) {
        const std::string serial = word == wanted ? "" : wanted.substr(0, wanted.size() - word.size() - 1);
        choice = choose_first(link, nodes, serial, true);
        choice.is_infrared = true;
        choice.is_alternating = is_alternating;
    } else if (wanted.find(',') != std::string::npos || wanted.starts_with("/dev/")) {
        choice = choose_named(link, nodes, wanted);
    } else {
        choice = choose_first(link, nodes, wanted, false);
    }
    choice.depth_metadata = metadata_path(nodes, choice.depth);
    choice.colour_metadata = metadata_path(nodes, choice.colour);
    return choice;
}

}  // namespace stillmesh::v4l2
