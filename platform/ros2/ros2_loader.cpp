#include "platform/linux/module.hpp"
#include "platform/ros2/ros2_module.hpp"

namespace stillmesh {

const Ros2Module* ros2_module(std::string& message) {
    return static_cast<const Ros2Module*>(open_module(
        {.name = "ros2",
         .absent = "needs Cyclone DDS, which is not in this build",
         .remedy = ". Install it and build again: sudo apt-get install cyclonedds-dev cyclonedds-tools && cmake "
                   "--preset release -DSTILLMESH_WITH_ROS2=ON && cmake --build build/release"},
        message));
}

}  // namespace stillmesh
