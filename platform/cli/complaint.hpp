// How the program says what is wrong: one sentence on standard error.
#pragma once

#include <cstdio>
#include <string>

#include "platform/cli/exit_code.hpp"

namespace stillmesh {

inline void complain(const std::string& sentence) {
    std::fprintf(stderr, "stillmesh: %s\n", sentence.c_str());
}

inline int refuse(const std::string& sentence) {
    complain(sentence);
    return kExitUsage;
}

}  // namespace stillmesh
