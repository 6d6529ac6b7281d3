// --base-from-camera of `run` and of `map export`: where the camera is on the robot.
#pragma once

#include <CLI/CLI.hpp>
#include <functional>
#include <string>

#include "engine/geometry/rigid_transform.hpp"
#include "platform/poses/body_frames.hpp"

namespace stillmesh {

inline CLI::Option* add_base_option(CLI::App& app, const std::function<void(const RigidTransform&)>& take) {
    return app
        .add_option_function<std::string>(
            "--base-from-camera",
            [take](const std::string& text) {
                RigidTransform base_from_camera_link;
                if (!parse_pose(text, base_from_camera_link)) {
                    throw CLI::ValidationError("--base-from-camera " + text,
                                               "give x,y,z (m) or x,y,z,qx,qy,qz,qw: where the camera is on the robot");
                }
                take(base_from_camera_link);
            },
            "where the camera is on the robot, base_link from camera_link (x forward, y left, z up); 0,0,0 if not "
            "given")
        ->type_name("X,Y,Z[,QX,QY,QZ,QW]");
}

}  // namespace stillmesh
