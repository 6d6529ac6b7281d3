// In a build without Cyclone DDS: whoever publishes has said so already.
#include "platform/ros2/ros_wishes.hpp"

namespace stillmesh {

class RosWishes::Listener {};

RosWishes::RosWishes() = default;
RosWishes::~RosWishes() = default;

bool RosWishes::open(const std::string& name_space, std::string& message) {
    static_cast<void>(name_space);
    message = "--publish ros2 needs Cyclone DDS, which is not in this build.";
    return false;
}

}  // namespace stillmesh
