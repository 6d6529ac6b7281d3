#include "engine/base/check.hpp"

// Weak here alone, so that a program's definition is an ordinary one, and two of them are an error.
// NOLINTNEXTLINE(readability-redundant-declaration)
extern "C" __attribute__((weak)) void stillmesh_check_failed(const char*, const char*, std::int32_t) noexcept;

namespace stillmesh {

void check_failed(const char* expression, const char* file, std::int32_t line) noexcept {
    if (&stillmesh_check_failed != nullptr) stillmesh_check_failed(expression, file, line);
    __builtin_trap();
}

}  // namespace stillmesh
