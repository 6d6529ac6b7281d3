// A library as the program opens it for ROS 2, of another version.
#include "platform/ros2/ros2_module.hpp"

const stillmesh::Ros2Module* stillmesh_ros2_module() {
    static constexpr stillmesh::Ros2Module kModule = {.version = "0.0.0",
                                                      .camera = nullptr,
                                                      .publisher = nullptr,
                                                      .wishes = nullptr,
                                                      .motion = nullptr,
                                                      .base_from_camera = nullptr};
    return &kModule;
}
