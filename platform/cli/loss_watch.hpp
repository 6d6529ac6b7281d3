// The longest time without a measured pose, and what the pixels said meanwhile.
#pragma once

#include <fmt/format.h>

#include <array>
#include <cstdint>
#include <string>

#include "platform/cli/frame_diagnosis.hpp"
#include "platform/cli/run_loop.hpp"
#include "platform/cli/session.hpp"

namespace stillmesh {

class LossWatch {
public:
    LossWatch(const RunLoopOptions& options, TrackingSession& session) : options_(options), session_(session) {}

    // `known`: what is wrong with the frame, if it is known. What was lost while a live camera itself was away does not
    // count.
    void frame(const Frame& frame, const SessionFrame& out, FrameFault known) {
        if (first_ns_ < 0) first_ns_ = last_measured_ns_ = last_ns_ = frame.time_ns;
        if (options_.is_live && frame.time_ns - last_ns_ > kGapNoted_ns) last_measured_ns_ += frame.time_ns - last_ns_;
        last_ns_ = frame.time_ns;
        fault_ = FrameFault::kNone;
        if (out.state >= PoseState::kUnsure) {
            end_of_loss(frame.time_ns);
            last_measured_ns_ = frame.time_ns;
            was_measured_ = true;
            is_hidden_ = out.dynamic_features > out.static_features;
            return;
        }
        ++lost_frames_;
        fault_ = known != FrameFault::kNone ? known : diagnose(frame, options_.depth_range);
        // Lost for so long among good pictures: is it the place, or what moves in it?
        if (fault_ == FrameFault::kNone && lost_ns() > kProbed_ns && options_.new_map_after_ns == 0 &&
            session_.could_begin_here(frame).value_or(false)) {
            is_elsewhere_ = was_elsewhere_ = true;
        }
        const FrameFault counted = fault_ == FrameFault::kNone && is_hidden_ ? FrameFault::kHidden : fault_;
        ++faults_[static_cast<std::size_t>(counted)];
        ++all_faults_[static_cast<std::size_t>(counted)];
        ++all_lost_frames_;
    }
    void finish() { end_of_loss(last_ns_); }
    [[nodiscard]] std::int64_t lost_ns() const { return lost_frames_ > 0 ? last_ns_ - last_measured_ns_ : 0; }
    // The last frame shows something that a map could begin with.
    [[nodiscard]] bool is_good_picture() const { return fault_ == FrameFault::kNone; }
    // Another map begins: what was lost is known, and is no failure.
    [[nodiscard]] std::string begin_anew() {
        const std::string sentence =
            fmt::format("second {:.1f}: no pose for {:.1f} s", second(last_ns_), static_cast<double>(lost_ns()) * 1e-9);
        last_measured_ns_ = last_ns_;
        lost_frames_ = 0;
        faults_ = {};
        was_measured_ = true;
        return sentence;
    }
    [[nodiscard]] double second(std::int64_t time_ns) const { return static_cast<double>(time_ns - first_ns_) * 1e-9; }
    [[nodiscard]] std::string sentence() const {
        if (longest_ns_ <= options_.lost_ns) return {};
        return fmt::format("no pose for {:.1f} s ({} frames) from second {:.1f} on: {}.",
                           static_cast<double>(longest_ns_) * 1e-9, longest_frames_, second(longest_begin_ns_),
                           fault_sentence(longest_fault_));
    }
    // What most of the frames without a measured pose say, of the whole run.
    [[nodiscard]] const char* fault() const {
        return fault_sentence(with_place(most_say(all_faults_, all_lost_frames_), was_elsewhere_));
    }

private:
    static constexpr std::int64_t kProbed_ns = 500'000'000;  // half of what is a failure
    using Counts = std::array<std::uint64_t, kFrameFaults>;
    // What more than half of the frames say; else the general sentence.
    [[nodiscard]] static FrameFault most_say(const Counts& faults, std::uint64_t frames) {
        FrameFault fault = FrameFault::kNone;
        for (std::size_t i = 0; i < faults.size(); ++i) {
            if (faults[i] * 2 > frames) fault = static_cast<FrameFault>(i);
        }
        return fault;
    }
    [[nodiscard]] FrameFault with_place(FrameFault fault, bool is_elsewhere) const {
        if (fault != FrameFault::kNone || !is_elsewhere) return fault;
        return options_.begins_in_map && !was_measured_ ? FrameFault::kOtherMap : FrameFault::kElsewhere;
    }
    void end_of_loss(std::int64_t now_ns) {
        if (lost_frames_ > 0 && now_ns - last_measured_ns_ > longest_ns_) {
            longest_ns_ = now_ns - last_measured_ns_;
            longest_begin_ns_ = last_measured_ns_;
            longest_frames_ = lost_frames_;
            longest_fault_ = with_place(most_say(faults_, lost_frames_), is_elsewhere_);
        }
        if (lost_frames_ > 0) session_.is_found_again();
        lost_frames_ = 0;
        faults_ = {};
        is_elsewhere_ = false;
    }

    const RunLoopOptions& options_;
    TrackingSession& session_;
    std::int64_t first_ns_ = -1, last_ns_ = 0, last_measured_ns_ = 0;
    std::uint64_t lost_frames_ = 0;
    Counts faults_{}, all_faults_{};
    std::uint64_t all_lost_frames_ = 0;
    FrameFault fault_ = FrameFault::kNone;  // of the last frame
    bool was_measured_ = false;             // ever
    bool is_hidden_ = false;                // most of what the last measured frame matched moved
    bool is_elsewhere_ = false, was_elsewhere_ = false;
    std::int64_t longest_ns_ = 0, longest_begin_ns_ = 0;
    std::uint64_t longest_frames_ = 0;
    FrameFault longest_fault_ = FrameFault::kNone;
};

}  // namespace stillmesh
