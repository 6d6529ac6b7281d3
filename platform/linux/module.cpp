#include "platform/linux/module.hpp"

#include <dlfcn.h>

#include <array>
#include <cstring>
#include <filesystem>
#include <system_error>

namespace stillmesh {

const void* open_module_file(const std::string& path, std::string& message) {
    void* const library = ::dlopen(path.c_str(), RTLD_NOW | RTLD_LOCAL);
    void* const symbol = library != nullptr ? ::dlsym(library, "stillmesh_module") : nullptr;
    if (symbol == nullptr) {
        const char* const why = ::dlerror();
        message = "needs " + path + ", which cannot be loaded: " + (why != nullptr ? why : "it has no function") + ".";
        return nullptr;
    }
    const Module& module = *reinterpret_cast<decltype(&stillmesh_module)>(symbol)();
    if (std::strcmp(module.version, STILLMESH_PROGRAM_VERSION) == 0) return module.calls;
    message = "needs " + path + " of version " STILLMESH_PROGRAM_VERSION ", which is of version " + module.version +
              ": install both from one build.";
    return nullptr;
}

const void* open_module(const ModuleWanted& wanted, std::string& message) {
    std::error_code error;
    const std::filesystem::path folder = std::filesystem::read_symlink("/proc/self/exe", error).parent_path();
    const std::string file = std::string("libstillmesh_") + wanted.name + ".so";
    const std::array places = {folder / file, (folder / STILLMESH_MODULE_FOLDER / file).lexically_normal()};
    for (const std::filesystem::path& place : places) {
        if (!folder.empty() && std::filesystem::exists(place, error)) return open_module_file(place, message);
    }
    message = wanted.absent;
    message += " (neither " + places[0].string() + " nor " + places[1].string() + " is there)";
    message += wanted.remedy;
    return nullptr;
}

}  // namespace stillmesh
