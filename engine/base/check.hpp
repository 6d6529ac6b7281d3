// CHECK: our own bugs, always on, in every build type. What the world does wrong (a device, bytes, a full pool) is a
// Status instead (status.hpp). A failed check never returns: the installed handler may print, then the program traps.
#pragma once

#include <cstdint>

#include "engine/base/api.hpp"

namespace stillmesh {

using CheckHandler = void (*)(const char* expression, const char* file, std::int32_t line) noexcept;

// Installs what a failed check calls before it traps; nullptr: trap at once. Not thread-safe: call it once, at start.
STILLMESH_API void set_check_handler(CheckHandler handler) noexcept;

[[noreturn]] STILLMESH_API void check_failed(const char* expression, const char* file, std::int32_t line) noexcept;

}  // namespace stillmesh

#define STILLMESH_CHECK(condition) \
    (static_cast<bool>(condition) ? static_cast<void>(0) : ::stillmesh::check_failed(#condition, __FILE__, __LINE__))
