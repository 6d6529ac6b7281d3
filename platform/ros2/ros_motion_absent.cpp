// In a build without Cyclone DDS.
#include "platform/ros2/ros_motion.hpp"

namespace stillmesh {

class RosMotion::Listener {};

RosMotion::RosMotion() = default;
RosMotion::~RosMotion() = default;

bool RosMotion::open(const RosMotionOptions& options, std::string& message) {
    static_cast<void>(options);
    message =
        "needs Cyclone DDS, which is not in this build. Install it and build again: sudo apt-get install "
        "cyclonedds-dev cyclonedds-tools && cmake --preset release -DSTILLMESH_WITH_ROS2=ON && cmake --build "
        "build/release";
    return false;
}

std::optional<MotionHint> RosMotion::between_times(std::int64_t from_ns, std::int64_t to_ns) const {
    static_cast<void>(from_ns);
    static_cast<void>(to_ns);
    return std::nullopt;
}

void RosMotion::between(std::int64_t after_ns, std::int64_t to_ns, std::vector<Acceleration>& out) const {
    static_cast<void>(after_ns);
    static_cast<void>(to_ns);
    out.clear();
}

}  // namespace stillmesh
