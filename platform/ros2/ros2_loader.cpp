#include <dlfcn.h>

#include <array>
#include <cstring>
#include <filesystem>
#include <system_error>

#include "platform/ros2/ros2_module.hpp"

namespace stillmesh {

const Ros2Module* ros2_module_in(const std::string& path, std::string& message) {
    void* const library = ::dlopen(path.c_str(), RTLD_NOW | RTLD_LOCAL);
    void* const symbol = library != nullptr ? ::dlsym(library, "stillmesh_ros2_module") : nullptr;
    if (symbol == nullptr) {
        const char* const why = ::dlerror();
        message =
            "needs " + path + ", which cannot be loaded: " + (why != nullptr ? why : "it has no such function") + ".";
        return nullptr;
    }
    const Ros2Module* const module = reinterpret_cast<decltype(&stillmesh_ros2_module)>(symbol)();
    if (std::strcmp(module->version, STILLMESH_PROGRAM_VERSION) == 0) return module;
    message = "needs " + path + " of version " STILLMESH_PROGRAM_VERSION ", which is of version " + module->version +
              ": install both from one build.";
    return nullptr;
}

const Ros2Module* ros2_module(std::string& message) {
    std::error_code error;
    const std::filesystem::path folder = std::filesystem::read_symlink("/proc/self/exe", error).parent_path();
    const std::array places = {folder / STILLMESH_ROS2_FILE,
                               (folder / STILLMESH_ROS2_FOLDER / STILLMESH_ROS2_FILE).lexically_normal()};
    for (const std::filesystem::path& place : places) {
        if (!folder.empty() && std::filesystem::exists(place, error)) return ros2_module_in(place, message);
    }
    message = "needs Cyclone DDS, which is not in this build (neither " + places[0].string() + " nor " +
              places[1].string() +
              " is there). Install it and build again: sudo apt-get install cyclonedds-dev cyclonedds-tools && cmake "
              "--preset release -DSTILLMESH_WITH_ROS2=ON && cmake --build build/release";
    return nullptr;
}

}  // namespace stillmesh
