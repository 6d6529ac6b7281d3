// Prints the expression of a failed CHECK before the program traps, so that death tests can say which one they expect.
// Including it in one file is enough; weak, because several files of one program may.
#pragma once

#include <cstdint>
#include <cstdio>

#include "engine/base/check.hpp"

extern "C" __attribute__((weak)) void stillmesh_check_failed(const char* expression, const char* file,
                                                             std::int32_t line) noexcept {
    std::fprintf(stderr, "CHECK failed: %s (%s:%d)\n", expression, file, static_cast<int>(line));
}
