// In a build without Cyclone DDS.
#include "platform/ros2/ros_publisher.hpp"

namespace stillmesh {

class RosPublisher::Sender {};

RosPublisher::RosPublisher() = default;
RosPublisher::~RosPublisher() = default;

bool RosPublisher::open(const RosOptions& options, std::string& message) {
    static_cast<void>(options);
    message =
        "--publish ros2 needs Cyclone DDS, which is not in this build. Install it and build again: sudo apt-get "
        "install cyclonedds-dev cyclonedds-tools && cmake --preset release -DSTILLMESH_WITH_ROS2=ON && cmake --build "
        "build/release";
    return false;
}

MapPoints* RosPublisher::points() noexcept {
    return nullptr;
}

GridShelf* RosPublisher::grid() noexcept {
    return nullptr;
}

std::string RosPublisher::frame(const PoseReport& report) {
    static_cast<void>(report);
    return {};
}

std::string RosPublisher::event(const std::string& sentence) {
    static_cast<void>(sentence);
    return {};
}

std::string RosPublisher::close() {
    return {};
}

}  // namespace stillmesh
