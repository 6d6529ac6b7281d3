#include "platform/cli/stream_log.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <utility>

namespace stillmesh {
namespace {

// Without depth: so long is worth a note, so long a word at once.
constexpr std::int64_t kNoDepthNoted_ns = 250'000'000;
constexpr std::int64_t kNoDepthTold_ns = 1'000'000'000;

[[nodiscard]] const char* name_of(FrameFault fault) {
    return fault == FrameFault::kColourStuck  ? "colour"
           : fault == FrameFault::kDepthStuck ? "depth"
                                              : "colour and depth";
}

}  // namespace

FrameFault StreamLog::fault() const {
    const bool is_colour = watch_.is_stuck(StreamWatch::kColour);
    const bool is_depth = watch_.is_stuck(StreamWatch::kDepth);
    if (is_colour && is_depth) return FrameFault::kBothStuck;
    return is_colour ? FrameFault::kColourStuck : is_depth ? FrameFault::kDepthStuck : FrameFault::kNone;
}

void StreamLog::frame(const Frame& frame) {
    if (first_ns_ < 0) first_ns_ = last_ns_ = frame.time_ns;
    watch_.look(frame);
    const FrameFault now = fault();
    if (now == FrameFault::kNone) {
        end_stuck();
    } else {
        if (stuck_frames_++ == 0) stuck_since_ns_ = frame.time_ns;
        if (stuck_frames_ <= StreamWatch::kToldAfter) stuck_ = now;
        record_.colour_repeats += watch_.is_stuck(StreamWatch::kColour) ? 1U : 0U;
        record_.depth_repeats += watch_.is_stuck(StreamWatch::kDepth) ? 1U : 0U;
        if (stuck_frames_ == StreamWatch::kToldAfter) {
            news_ = fmt::format("second {:.1f}: the {} images repeat to the bit: no poses until they change.",
                                second(stuck_since_ns_), name_of(stuck_));
        }
    }
    if (watch_.has_depth()) {
        end_no_depth(frame.time_ns);
    } else {
        if (no_depth_since_ns_ < 0) no_depth_since_ns_ = frame.time_ns;
        if (!is_no_depth_told_ && frame.time_ns - no_depth_since_ns_ >= kNoDepthTold_ns) {
            is_no_depth_told_ = true;
            news_ += (news_.empty() ? "" : " ") +
                     fmt::format("second {:.1f}: the depth images are empty.", second(no_depth_since_ns_));
        }
    }
    last_ns_ = frame.time_ns;
}

void StreamLog::end_stuck() {
    if (stuck_frames_ >= StreamWatch::kToldAfter) {
        ++record_.times_stuck;
        if (record_.stuck.size() < StreamRecord::kEpisodesMax) {
            record_.stuck.push_back({name_of(stuck_), second(stuck_since_ns_),
                                     static_cast<double>(last_ns_ - stuck_since_ns_) * 1e-9, stuck_frames_});
        }
    }
    stuck_frames_ = 0;
}

void StreamLog::end_no_depth(std::int64_t now_ns) {
    if (no_depth_since_ns_ >= 0 && now_ns - no_depth_since_ns_ > kNoDepthNoted_ns) {
        const double length_s = static_cast<double>(now_ns - no_depth_since_ns_) * 1e-9;
        record_.no_depth_s += length_s;
        if (length_s > record_.no_depth_longest_s) {
            record_.no_depth_longest_s = length_s;
            record_.no_depth_longest_at_s = second(no_depth_since_ns_);
        }
    }
    no_depth_since_ns_ = -1;
    is_no_depth_told_ = false;
}

std::string StreamLog::take_news() {
    return std::exchange(news_, {});
}

void StreamLog::account(RunRecord& record) {
    end_stuck();
    end_no_depth(last_ns_);
    record.streams = record_;
    if (record_.no_depth_longest_s > 0) {
        record.notes.push_back(fmt::format("no depth for {:.1f} s from second {:.1f} on{}.", record_.no_depth_longest_s,
                                           record_.no_depth_longest_at_s,
                                           record_.no_depth_s > 1.01 * record_.no_depth_longest_s
                                               ? fmt::format(", {:.1f} s in all", record_.no_depth_s)
                                               : std::string()));
    }
}

}  // namespace stillmesh
