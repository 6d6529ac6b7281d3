#include "hal/v4l2/survey.hpp"

#include <algorithm>
#include <cerrno>

#include "hal/v4l2/camera_choice.hpp"
#include "hal/v4l2/realsense_tables.hpp"

namespace stillmesh::v4l2 {
namespace {

// To ask for buffers is refused while somebody else has some, and does nothing else.
[[nodiscard]] bool is_busy(V4l2Link& link, const std::string& path) {
    int handle = -1;
    if (link.open(path, handle) != 0) return false;
    std::uint32_t count = 1;
    const bool is_held = link.request_buffers(handle, count) == EBUSY;
    count = 0;
    if (!is_held) static_cast<void>(link.request_buffers(handle, count));
    link.close(handle);
    return is_held;
}

void look_at(V4l2Link& link, const V4l2Node& node, VideoNodes& seen) {
    seen.paths.push_back(node.path);
    const AskedNode asked = ask_node(link, node);
    const bool is_absent = asked.error == ENOENT;
    const bool is_denied = asked.error == EACCES || asked.error == EPERM;
    if (is_absent && seen.absent.empty()) seen.absent = node.path;
    if (is_denied && seen.denied.empty()) seen.denied = node.path;
    if (asked.error != 0 && !is_absent && !is_denied && seen.broken.empty()) seen.broken = node.path;
    if (!asked.is_capture) return;
    if (seen.busy.empty() && is_busy(link, node.path)) seen.busy = node.path;
    if (has_depth(asked) && seen.depth_modes.empty()) {
        seen.depth_modes = modes_text(asked.modes, true);
    } else if (has_colour(asked)) {
        seen.colour_modes = modes_text(asked.modes, false);  // of the last: infrared comes before colour
    }
}

}  // namespace

std::vector<VideoNodes> survey(V4l2Link& link) {
    std::vector<VideoNodes> cameras;
    for (const V4l2Node& node : link.nodes()) {
        if (realsense_name(node.vendor_id, node.product_id) == nullptr) continue;
        auto camera = std::find_if(cameras.begin(), cameras.end(),
                                   [&node](const VideoNodes& one) { return one.usb_port == node.usb_port; });
        if (camera == cameras.end()) {
            cameras.push_back({});
            camera = cameras.end() - 1;
            camera->usb_port = node.usb_port;
        }
        look_at(link, node, *camera);
    }
    return cameras;
}

}  // namespace stillmesh::v4l2
