// Where a run is: one line that rewrites itself on a terminal, a plain line now and then elsewhere. On standard error,
// so that standard output stays what it is for: the summary.
#pragma once

#include <cstdint>
#include <string>

#include "platform/report/run_record.hpp"

namespace stillmesh {

class ProgressLine {
public:
    ProgressLine(bool is_shown, std::uint64_t frames_expected);
    void frame(std::uint64_t count, PoseState state, std::int64_t now_ns);
    // A sentence on a line of its own, shown whatever was asked for: what happens to a camera is no progress.
    void say(const std::string& sentence);
    // Ends the rewritten line.
    void finish();

private:
    bool is_shown_;
    bool is_terminal_;
    bool is_line_open_ = false;
    std::uint64_t frames_expected_;
    std::int64_t begin_ns_ = 0;
    std::int64_t last_ns_ = 0;
};

}  // namespace stillmesh
