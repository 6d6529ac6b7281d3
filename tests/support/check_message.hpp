// Prints the expression of a failed CHECK before the program traps, so that death tests can say which one they expect.
#pragma once

#include <cstdint>
#include <cstdio>

#include "engine/base/check.hpp"

namespace stillmesh::test {

inline void print_check(const char* expression, const char* file, std::int32_t line) noexcept {
    std::fprintf(stderr, "CHECK failed: %s (%s:%d)\n", expression, file, static_cast<int>(line));
}

// One static object of this kind in a test file installs the handler for the whole program.
struct PrintChecks {
    PrintChecks() noexcept { set_check_handler(&print_check); }
};

}  // namespace stillmesh::test
