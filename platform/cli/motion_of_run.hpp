// Who says how the camera of a run moves, beside the camera: `--odometry` and `--gyro`, files or topics of ROS 2, else
// the files of a folder that is replayed.
#pragma once

#include <memory>
#include <optional>
#include <string>

#include "platform/cli/run_command.hpp"
#include "platform/motion/gravity_finder.hpp"
#include "platform/motion/motion_samples.hpp"

namespace stillmesh {

// Whether the value of one of these options is a topic of ROS 2.
[[nodiscard]] bool is_ros_motion(const std::string& value);
// What is wrong with these options beside the camera's; empty: nothing.
[[nodiscard]] std::string motion_problem(const RunArguments& arguments);
// `motion` stays empty where nobody says anything. False: `message`.
[[nodiscard]] bool open_motion(const RunArguments& arguments, const std::string& folder,
                               std::unique_ptr<MotionSource>& motion, std::string& message);

// What --level gravity needs; `source` stays empty where nobody asked. False: `message`.
[[nodiscard]] bool open_accelerometer(const RunArguments& arguments, const std::string& folder,
                                      std::unique_ptr<AccelerationSource>& source, std::string& message);

// `--base-from-camera tf_static` of `--camera ros2`, whose images come: `placed` is `arguments` with what the robot
// says. False: `message`.
[[nodiscard]] bool place_on_robot(const RunArguments& arguments, std::optional<RunArguments>& placed,
                                  std::string& message);

}  // namespace stillmesh
