// --base-from-camera of `run` and of `map export`: where the camera is on the robot.
#pragma once

#include <CLI/CLI.hpp>
#include <functional>
#include <string>

#include "engine/geometry/rigid_transform.hpp"
#include "platform/poses/body_frames.hpp"

namespace stillmesh {

// `take_from_tf`: of `run`, which can ask the robot.
inline CLI::Option* add_base_option(CLI::App& app, const std::function<void(const RigidTransform&)>& take,
                                    const std::function<void()>& take_from_tf = {}) {
    return app
        .add_option_function<std::string>(
            "--base-from-camera",
            [take, take_from_tf](const std::string& text) {
                if (take_from_tf && text == "tf_static") return take_from_tf();
                RigidTransform base_from_camera_link;
                if (!parse_pose(text, base_from_camera_link)) {
                    throw CLI::ValidationError("--base-from-camera " + text,
                                               "give x,y,z (m) or x,y,z,qx,qy,qz,qw: where the camera is on the robot");
                }
                take(base_from_camera_link);
            },
            "where the camera is on the robot, base_link from camera_link (x forward, y left, z up); 0,0,0 if not "
            "given" +
                std::string(take_from_tf ? "; tf_static: as the robot itself says on ROS 2, with --camera ros2" : ""))
        ->type_name(take_from_tf ? "X,Y,Z[,QX,QY,QZ,QW]|tf_static" : "X,Y,Z[,QX,QY,QZ,QW]");
}

}  // namespace stillmesh
