// Which names ROS 2 allows for topics and namespaces.
#pragma once

#include <string>
#include <string_view>

namespace stillmesh {

// Letters, digits and _ between single slashes, no part beginning with a digit; one slash at the begin is allowed.
[[nodiscard]] constexpr bool is_ros_name(std::string_view name) noexcept {
    if (!name.empty() && name.front() == '/') name.remove_prefix(1);
    bool is_begin = true;
    for (const char c : name) {
        const bool is_digit = c >= '0' && c <= '9';
        const bool is_letter = (c >= 'a' && c <= 'z') || (c >= 'A' && c <= 'Z') || c == '_';
        if (c == '/' ? is_begin : !is_letter && (!is_digit || is_begin)) return false;
        is_begin = c == '/';
    }
    return !name.empty() && !is_begin;
}

// "image_rect", "image_rect_color": the last part of a topic's name that is not a transport's.
[[nodiscard]] constexpr bool is_rectified_name(std::string_view topic) noexcept {
    return topic.find("/image_rect") != std::string_view::npos;
}

// CameraInfo of a topic's images lies beside it, whatever its transport (image_transport's rule): of
// /camera/depth/image_raw/compressedDepth that is /camera/depth/camera_info.
[[nodiscard]] inline std::string info_beside(std::string_view topic) {
    for (const std::string_view transport : {"/compressed", "/compressedDepth"}) {
        if (topic.ends_with(transport)) topic.remove_suffix(transport.size());
    }
    const std::size_t last = topic.rfind('/');
    return std::string(topic.substr(0, last == std::string_view::npos ? 0 : last)) + "/camera_info";
}

}  // namespace stillmesh
