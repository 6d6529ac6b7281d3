// In a build without Cyclone DDS.
#include "platform/ros2/ros_base.hpp"

namespace stillmesh {

std::optional<RigidTransform> base_from_camera_by_tf(const RosBaseQuestion& question, std::string& message) {
    static_cast<void>(question);
    message =
        "needs Cyclone DDS, which is not in this build. Install it and build again: sudo apt-get install "
        "cyclonedds-dev cyclonedds-tools && cmake --preset release -DSTILLMESH_WITH_ROS2=ON && cmake --build "
        "build/release";
    return std::nullopt;
}

}  // namespace stillmesh
