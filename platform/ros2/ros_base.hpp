// `--base-from-camera tf_static`: where a robot itself says that its camera is (/tf_static, or that of a namespace of
// the images, from its base to the frame that CameraInfo of the colour images names), asked once, before a run begins.
// Cost: until both have come, kRosBaseWait_ms at most. The program calls it through ros2_module.hpp.
#pragma once

#include <cstdint>
#include <optional>
#include <string>

#include "engine/geometry/rigid_transform.hpp"

namespace stillmesh {

inline constexpr std::uint32_t kRosBaseWait_ms = 5000;

struct RosBaseQuestion {
    std::string topics;  // of the camera: COLOUR,DEPTH,INFO; empty: those of the realsense driver
    std::string base = "base_link";
};

// camera_link (x ahead, y left, z up) on the base. Empty: `message` says what was not told, and what to do.
[[nodiscard]] std::optional<RigidTransform> base_from_camera_by_tf(const RosBaseQuestion& question,
                                                                   std::string& message);

}  // namespace stillmesh
