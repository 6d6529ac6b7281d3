// Apart from the camera, so that who asks for its topics alone does not bring it along.
#include "hal/ros2/ros2_camera.hpp"
#include "hal/ros2/ros_name.hpp"

namespace stillmesh {

bool parse_ros2_topics(const std::string& text, Ros2Options& options) {
    const std::size_t first = text.find(',');
    const std::size_t second = first == std::string::npos ? first : text.find(',', first + 1);
    if (second == std::string::npos) return false;
    options.colour = text.substr(0, first);
    options.depth = text.substr(first + 1, second - first - 1);
    options.info = text.substr(second + 1);
    for (std::string* const name : {&options.colour, &options.depth, &options.info}) {
        if (!is_ros_name(*name)) return false;
        if (name->front() != '/') *name = std::string("/").append(*name);
    }
    return true;
}

}  // namespace stillmesh
