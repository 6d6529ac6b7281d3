// `--odometry ros2[:TOPIC]`, `--gyro ros2[:TOPIC]`, `--accelerometer ros2[:TOPIC]`: what wheels (nav_msgs/Odometry,
// /odom_in), a gyroscope and an accelerometer (sensor_msgs/Imu, /imu) of a robot with ROS 2 say of the camera's motion,
// for frames of `--camera ros2`, whose stamps are of the same clock. A thread takes messages and keeps the last
// kSamplesMax of each; what a frame's time is not covered by when it is asked for has no hint, and nobody waits. Poses
// are those of base_link in any frame that stays; rates and accelerations are in base_link's axes, or, where the
// message's frame ends in optical_frame, in the camera's; where on the robot they are measured is left out. Subscribed
// at best effort. Memory: 132 KiB, and Cyclone's own. Made by ros2_module.hpp: what
// the program calls is virtual.
#pragma once

#include <cstdint>
#include <memory>
#include <optional>
#include <string>
#include <string_view>
#include <vector>

#include "engine/geometry/rigid_transform.hpp"
#include "platform/motion/gravity_finder.hpp"
#include "platform/motion/motion_samples.hpp"

namespace stillmesh {

struct RosMotionOptions {
    std::string odometry, imu, accelerometer;  // topics; empty: not subscribed
    MotionErrors errors;
    RigidTransform base_from_camera_link{};
};

// "ros2" or "ros2:TOPIC": the topic, else `preset`. Empty: it is another word.
[[nodiscard]] std::string ros_motion_topic(std::string_view text, const char* preset);

class RosMotion : public MotionSource, public AccelerationSource {
public:
    static constexpr std::size_t kSamplesMax = 1024;

    RosMotion();
    ~RosMotion() override;
    // False: `message` says why.
    [[nodiscard]] virtual bool open(const RosMotionOptions& options, std::string& message);
    [[nodiscard]] std::optional<MotionHint> between_times(std::int64_t from_ns, std::int64_t to_ns) const override;
    void between(std::int64_t after_ns, std::int64_t to_ns, std::vector<Acceleration>& out) const override;
    [[nodiscard]] const std::string& sources() const override { return sources_; }

private:
    class Listener;
    std::unique_ptr<Listener> listener_;
    std::string sources_ = "ROS 2";
};

}  // namespace stillmesh
