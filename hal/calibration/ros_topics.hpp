// What names of topics say by the customs of ROS, live and in bags: which image one is, and where its camera is.
#pragma once

#include <string>
#include <string_view>

namespace stillmesh {

// "image_rect", "image_rect_color": the last part of a topic's name that is not a transport's.
[[nodiscard]] constexpr bool is_rectified_name(std::string_view topic) noexcept {
    return topic.find("/image_rect") != std::string_view::npos;
}

// "/camera/rgb/image_raw" of "/camera/rgb/image_raw/compressed".
[[nodiscard]] constexpr std::string_view without_transport(std::string_view topic) noexcept {
    for (const std::string_view transport : {"/compressedDepth", "/compressed"}) {
        if (topic.ends_with(transport)) return topic.substr(0, topic.size() - transport.size());
    }
    return topic;
}

// CameraInfo of a topic's images lies beside it, whatever its transport (image_transport's rule): of
// /camera/depth/image_raw/compressedDepth that is /camera/depth/camera_info.
[[nodiscard]] inline std::string info_beside(std::string_view topic) {
    const std::string_view image = without_transport(topic);
    const std::size_t last = image.rfind('/');
    return std::string(image.substr(0, last == std::string_view::npos ? 0 : last)) + "/camera_info";
}

}  // namespace stillmesh
