// Text whose lines are a time and three numbers, as gyroscopes and accelerometers have it: '#' begins a comment, times
// in seconds go up. Any bytes are safe.
#pragma once

#include <cstdint>
#include <functional>
#include <string>
#include <string_view>

#include "engine/base/status.hpp"
#include "platform/motion/motion_steps.hpp"

namespace stillmesh {

struct TripleKind {
    const char* line;      // what one is, for messages
    double most;           // that one of its numbers can be
    const char* too_much;  // what a larger one is no value of, and what it may be
};

// Calls `take` for each line. kInvalid: a line that cannot be one, or fewer than two; `message` names file and line.
[[nodiscard]] Status parse_triples(std::string_view text, const std::string& file, const TripleKind& kind,
                                   const std::function<void(std::int64_t time_ns, const Triple& value)>& take,
                                   std::string& message);
// The same of a file. kUnavailable: it cannot be read.
[[nodiscard]] Status read_triples(const std::string& file, const TripleKind& kind,
                                  const std::function<void(std::int64_t time_ns, const Triple& value)>& take,
                                  std::string& message);
// One line with its line feed.
[[nodiscard]] std::string triple_line(std::int64_t time_ns, const Triple& value);

}  // namespace stillmesh
