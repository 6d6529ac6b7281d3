// What the streams of a run were like: which was stuck, when and for how long, and when there was no depth. Says so
// once for each episode while it lasts, and keeps it for the summary.
#pragma once

#include <cstdint>
#include <string>

#include "hal/live/stream_watch.hpp"
#include "platform/cli/frame_diagnosis.hpp"
#include "platform/report/run_record.hpp"

namespace stillmesh {

class StreamLog {
public:
    // The next frame. What it shows is old where fault() is not kNone: nobody can say from it where the camera is.
    void frame(const Frame& frame);
    // kNone, or which stream is stuck.
    [[nodiscard]] FrameFault fault() const;
    // To be said now; empty: nothing.
    [[nodiscard]] std::string take_news();
    // Counts, and notes of what is over.
    void account(RunRecord& record);

private:
    void end_stuck();
    void end_no_depth(std::int64_t now_ns);
    [[nodiscard]] double second(std::int64_t time_ns) const { return static_cast<double>(time_ns - first_ns_) * 1e-9; }

    StreamWatch watch_;
    StreamRecord record_;
    std::string news_;
    std::int64_t first_ns_ = -1, last_ns_ = 0;
    std::int64_t stuck_since_ns_ = -1;     // -1: it is not
    std::int64_t no_depth_since_ns_ = -1;  // -1: there is some
    std::uint32_t stuck_frames_ = 0;
    FrameFault stuck_ = FrameFault::kNone;  // of the episode
    bool is_no_depth_told_ = false;
};

}  // namespace stillmesh
