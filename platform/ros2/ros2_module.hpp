// All of ROS 2 that needs Cyclone DDS, as a module (platform/linux/module.hpp): a run that asks for nothing of ROS 2
// has neither in its memory.
#pragma once

#include <memory>
#include <optional>
#include <string>

#include "hal/ros2/ros2_camera.hpp"
#include "platform/ros2/ros_base.hpp"
#include "platform/ros2/ros_motion.hpp"
#include "platform/ros2/ros_publisher.hpp"
#include "platform/ros2/ros_wishes.hpp"

namespace stillmesh {

// What it makes; each is opened by its own open().
struct Ros2Module {
    std::unique_ptr<LiveCamera> (*camera)(Ros2Options options);
    std::unique_ptr<RosPublisher> (*publisher)();
    std::unique_ptr<RosWishes> (*wishes)();
    std::unique_ptr<RosMotion> (*motion)();
    std::optional<RigidTransform> (*base_from_camera)(const RosBaseQuestion& question, std::string& message);
};

// nullptr: `message` says what an option of ROS 2 "needs", and what to do.
[[nodiscard]] const Ros2Module* ros2_module(std::string& message);

}  // namespace stillmesh
