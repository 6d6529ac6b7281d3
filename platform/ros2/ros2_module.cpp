// The library's door.
#include "platform/ros2/ros2_module.hpp"

#include <utility>

const stillmesh::Ros2Module* stillmesh_ros2_module() {
    using namespace stillmesh;
    static constexpr Ros2Module kModule = {
        .version = STILLMESH_PROGRAM_VERSION,
        .camera = [](Ros2Options options) -> std::unique_ptr<LiveCamera> {
            return std::make_unique<Ros2Camera>(std::move(options));
        },
        .publisher = [] { return std::make_unique<RosPublisher>(); },
        .wishes = [] { return std::make_unique<RosWishes>(); },
        .motion = [] { return std::make_unique<RosMotion>(); },
        .base_from_camera = base_from_camera_by_tf,
    };
    return &kModule;
}
