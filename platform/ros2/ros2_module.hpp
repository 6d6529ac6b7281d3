// All of ROS 2 in a library of its own, which is opened when somebody asks for it: a run without ROS 2 has nothing of
// Cyclone DDS, nor of what that is linked with, in its memory. It lies beside the program (build tree, workspace of
// ROS 2) or where it is installed, <libdir>/stillmesh, seen from the program's own folder, and nowhere else:
// LD_LIBRARY_PATH is not asked, so that whoever could put another one there could also replace the program. It is never
// closed: threads of Cyclone run in it, and what it has made has its code there. Apart from the one function that
// gives the table below nothing in it can be seen from outside, and it sees nothing of the program: what both need is
// in both, as constant code; what one has to tell the other goes through the objects made here. Both are of one build.
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

// What the library makes; each is opened by its own open().
struct Ros2Module {
    const char* version;  // of Stillmesh; the first, so that it can be read whatever follows
    std::unique_ptr<LiveCamera> (*camera)(Ros2Options options);
    std::unique_ptr<RosPublisher> (*publisher)();
    std::unique_ptr<RosWishes> (*wishes)();
    std::unique_ptr<RosMotion> (*motion)();
    std::optional<RigidTransform> (*base_from_camera)(const RosBaseQuestion& question, std::string& message);
};

// nullptr: `message` says what an option of ROS 2 "needs", and what to do.
[[nodiscard]] const Ros2Module* ros2_module(std::string& message);
// The same of a file that is there, by its whole path.
[[nodiscard]] const Ros2Module* ros2_module_in(const std::string& path, std::string& message);

}  // namespace stillmesh

// Of the library.
extern "C" const stillmesh::Ros2Module* stillmesh_ros2_module();
