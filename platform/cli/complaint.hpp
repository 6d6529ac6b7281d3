// How the program says what is wrong: one sentence on standard error, an error in a journal.
#pragma once

#include <string>
#include <string_view>

#include "platform/cli/exit_code.hpp"
#include "platform/linux/service.hpp"
#include "platform/linux/text_output.hpp"

namespace stillmesh {

inline void complain(const std::string& sentence, LogLevel level = LogLevel::kError) {
    write_standard_error(log_entry(level, "stillmesh: " + printable(sentence)));
}

inline int refuse(const std::string& sentence) {
    complain(sentence);
    return kExitUsage;
}

// Text that is asked for, to standard output; whoever reads it may stop early.
inline int answer(std::string_view text) {
    std::string message;
    if (write_for_reader(text, message)) return kExitDone;
    complain(message);
    return kExitFailed;
}

}  // namespace stillmesh
