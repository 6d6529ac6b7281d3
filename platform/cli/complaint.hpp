// How the program says what is wrong: one sentence on standard error, an error in a journal.
#pragma once

#include <cstdio>
#include <string>

#include "platform/cli/exit_code.hpp"
#include "platform/linux/service.hpp"

namespace stillmesh {

inline void complain(const std::string& sentence, LogLevel level = LogLevel::kError) {
    std::fprintf(stderr, "%sstillmesh: %s\n", log_prefix(level), sentence.c_str());
}

inline int refuse(const std::string& sentence) {
    complain(sentence);
    return kExitUsage;
}

}  // namespace stillmesh
