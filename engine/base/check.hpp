// CHECK: our own bugs, always on, in every build type. What the world does wrong (a device, bytes, a full pool) is a
// Status instead (status.hpp). A failed check never returns: it tells the program, if that wants to know, then traps.
// Whom it tells is settled by the linker and not by a pointer: the engine has no variable that anything could
// overwrite.
#pragma once

#include <cstdint>

#include "engine/base/api.hpp"

// A program that wants to say what failed before it dies defines this function, in an object file of its own (out of a
// library the linker fetches nothing for a weak reference). Without it a failed check traps at once. It may be called
// from any place in the engine, on any thread that runs one: print, then return or end the process.
extern "C" STILLMESH_API void stillmesh_check_failed(const char* expression, const char* file,
                                                     std::int32_t line) noexcept;

namespace stillmesh {

[[noreturn]] STILLMESH_API void check_failed(const char* expression, const char* file, std::int32_t line) noexcept;

}  // namespace stillmesh

#define STILLMESH_CHECK(condition) \
    (static_cast<bool>(condition) ? static_cast<void>(0) : ::stillmesh::check_failed(#condition, __FILE__, __LINE__))
