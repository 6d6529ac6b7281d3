// In every build: to say what is missing, the word has to be known.
#include "platform/ros2/ros_motion.hpp"

namespace stillmesh {

std::string ros_motion_topic(std::string_view text, const char* preset) {
    if (text == "ros2") return preset;
    if (!text.starts_with("ros2:") || text.size() == 5) return {};
    const std::string topic(text.substr(5));
    return topic.front() == '/' ? topic : "/" + topic;
}

}  // namespace stillmesh
