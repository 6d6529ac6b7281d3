// What ROS 2 wants of a run with `--publish ros2`: topics where a node of ROS would have services, since a service
// needs types and two topics for each call that plain DDS has no tools for. A thread takes messages and puts them into
// the run's queue (platform/view/view_commands.hpp); the run looks into it between two frames and says on /diagnostics
// what it did. Whatever the bytes are, nothing else can come out. Full: the wish is dropped.
//   /stillmesh/save_map       std_msgs/Empty
//   /stillmesh/reset          std_msgs/Empty
//   /stillmesh/localize_only  std_msgs/Bool
// Memory: Cyclone's own, and a thread. Made by ros2_module.hpp: what the program calls is virtual.
#pragma once

#include <memory>
#include <string>

#include "platform/view/view_commands.hpp"

namespace stillmesh {

class RosWishes {
public:
    RosWishes();
    virtual ~RosWishes();
    RosWishes(const RosWishes&) = delete;
    RosWishes& operator=(const RosWishes&) = delete;

    // `name_space`: empty, or that of the run's own topics. False: `message` says why.
    [[nodiscard]] virtual bool open(const std::string& name_space, std::string& message);
    // The run takes from here; wishes lie in it from open() on.
    [[nodiscard]] ViewCommands& commands() noexcept { return commands_; }

private:
    class Listener;
    ViewCommands commands_;
    std::unique_ptr<Listener> listener_;  // ends before what it fills
};

}  // namespace stillmesh
