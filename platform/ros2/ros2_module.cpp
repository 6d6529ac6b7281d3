#include "platform/ros2/ros2_module.hpp"

#include <utility>

#include "platform/linux/module.hpp"

const stillmesh::Module* stillmesh_module() {
    using namespace stillmesh;
    static constexpr Ros2Module kCalls = {
        .camera = [](Ros2Options options) -> std::unique_ptr<LiveCamera> {
            return std::make_unique<Ros2Camera>(std::move(options));
        },
        .publisher = [] { return std::make_unique<RosPublisher>(); },
        .wishes = [] { return std::make_unique<RosWishes>(); },
        .motion = [] { return std::make_unique<RosMotion>(); },
        .base_from_camera = base_from_camera_by_tf,
    };
    static constexpr Module kModule = {.version = STILLMESH_PROGRAM_VERSION, .calls = &kCalls};
    return &kModule;
}
