// The options of `run` that give poses to a robot: by ROS 2 and by MAVLink. Read once, at the start.
#pragma once

#include <CLI/CLI.hpp>
#include <map>
#include <string>

#include "platform/cli/base_option.hpp"
#include "platform/mavlink/mavlink_output.hpp"
#include "platform/ros2/ros_motion.hpp"
#include "platform/ros2/ros_publisher.hpp"

namespace stillmesh {

inline void add_ros_options(CLI::App& app, RosOptions& options) {
    constexpr const char* kGroup = "ROS 2 (--publish ros2)";
    CLI::Option* const publish =
        app.add_option_function<std::string>(
               "--publish", [&options](const std::string&) { options.is_on = true; },
               "ros2: poses, path, map points and diagnostics as topics of ROS 2, which need not be installed; "
               "ROS_DOMAIN_ID and ROS_LOCALHOST_ONLY count (docs/ros2.md)")
            ->check(CLI::IsMember({"ros2"}).description(""))
            ->type_name("ros2")
            ->group(kGroup);
    app.add_option("--ros-namespace", options.name_space, "of /odom and /stillmesh/..., such as robot1")
        ->type_name("NAME")
        ->needs(publish)
        ->group(kGroup);
    app.add_option("--ros-frame-prefix", options.frame_prefix, "of map, odom, base_link and the camera's, as robot1/")
        ->type_name("TEXT")
        ->needs(publish)
        ->group(kGroup);
    app.add_flag("--tf,!--no-tf", options.has_tf,
                 "/tf and /tf_static (the default); --no-tf where another program says where base_link is")
        ->needs(publish)
        ->group(kGroup);
}

inline void add_mavlink_options(CLI::App& app, MavlinkOptions& options) {
    constexpr const char* kGroup = "MAVLink (--mavlink)";
    CLI::Option* const mavlink =
        app.add_option("--mavlink", options.destination,
                       "poses for an autopilot (PX4, ArduPilot), MAVLink 2 in datagrams (docs/mavlink.md)")
            ->type_name("udp:HOST:PORT")
            ->group(kGroup);
    app.add_option("--mavlink-message", options.message,
                   "odometry (default: ODOMETRY, with velocity) or vision (VISION_POSITION_ESTIMATE)")
        ->transform(
            CLI::CheckedTransformer(std::map<std::string, MavlinkMessage>{{"odometry", MavlinkMessage::kOdometry},
                                                                          {"vision", MavlinkMessage::kVision}})
                .description(""))
        ->type_name("NAME")
        ->needs(mavlink)
        ->group(kGroup);
    app.add_option("--mavlink-system", options.system, "the vehicle's number, its MAV_SYS_ID or SYSID_THISMAV (1)")
        ->check(CLI::Range(1, 255).description(""))
        ->type_name("N")
        ->needs(mavlink)
        ->group(kGroup);
}

inline void add_publish_options(CLI::App& app, RosOptions& ros, MavlinkOptions& mavlink) {
    add_ros_options(app, ros);
    add_mavlink_options(app, mavlink);
    CLI::Option* const base = add_base_option(
                                  app,
                                  [&ros, &mavlink](const RigidTransform& base_from_camera_link) {
                                      ros.base_from_camera_link = mavlink.base_from_camera_link = base_from_camera_link;
                                  },
                                  [&ros] { ros.is_base_from_tf = true; })
                                  ->group("ROS 2 (--publish ros2)");
    app.parse_complete_callback([&app, base, &ros, &mavlink] {
        const auto is_of_ros = [&app](const char* name) {
            const CLI::Option* const option = app.get_option(name);
            return option->count() > 0 && !ros_motion_topic(option->as<std::string>(), "/").empty();
        };
        if (base->count() > 0 && !ros.is_on && mavlink.destination.empty() && !is_of_ros("--odometry") &&
            !is_of_ros("--gyro")) {
            throw CLI::RequiresError("--base-from-camera", "--publish, --mavlink or --odometry ros2");
        }
    });
}

}  // namespace stillmesh
