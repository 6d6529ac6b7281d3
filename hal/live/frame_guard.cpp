#include "hal/live/frame_guard.hpp"

#include <algorithm>
#include <cmath>

namespace stillmesh {
namespace {

constexpr std::int64_t kTimeMax_ns = std::int64_t{1} << 61;

}  // namespace

void FrameGuard::reopened() noexcept {
    is_reopened_ = true;
    strangers_ = 0;
    streams_.reset();
    frozen_ns_ = 0;
}

bool FrameGuard::has_right_form(const Frame& frame) const noexcept {
    const CameraModel& model = info_.model;
    return (frame.format == PixelFormat::kGrey8 || frame.format == PixelFormat::kRgb8 ||
            frame.format == PixelFormat::kBgr8) &&
           frame.colour.data != nullptr && frame.depth.data != nullptr && frame.colour.width == model.width &&
           frame.colour.height == model.height && frame.depth.width == model.width &&
           frame.depth.height == model.height &&
           frame.colour.stride >= std::size_t{model.width} * channels_of(frame.format) &&
           frame.depth.stride >= model.width && std::isfinite(frame.depth_units_per_m) && frame.depth_units_per_m > 0;
}

bool FrameGuard::follows(std::int64_t time_ns, std::int64_t arrival_ns, std::int64_t before_ns,
                         std::int64_t before_arrival_ns) const noexcept {
    const std::int64_t step_ns = time_ns - before_ns;
    if (step_ns <= 0) return false;
    const std::int64_t expected_ns = has_host_clock_ ? arrival_ns - before_arrival_ns : 0;
    return step_ns <= expected_ns + kJump_ns && (!has_host_clock_ || step_ns >= expected_ns - kJump_ns);
}

Status FrameGuard::admit(Frame& frame, std::int64_t arrival_ns) noexcept {
    if (!has_right_form(frame)) {
        ++counts_.wrong_form;
        return Status::kInvalid;
    }
    const std::int64_t time_ns = frame.time_ns;
    if (time_ns < 0 || time_ns > kTimeMax_ns) {
        ++counts_.wrong_time;
        return Status::kCorrupt;
    }
    const auto period_ns = static_cast<std::int64_t>(1e9 / std::max(info_.frames_per_s, 1.0));
    if (!has_last_) {
        shift_ns_ = 0;
    } else if (is_reopened_ || !follows(time_ns, arrival_ns, last_ns_, last_arrival_ns_)) {
        const bool agrees = strangers_ > 0 && follows(time_ns, arrival_ns, stranger_ns_, stranger_arrival_ns_);
        strangers_ = agrees ? strangers_ + 1 : 1;
        if (!agrees) first_stranger_ns_ = time_ns;
        stranger_ns_ = time_ns;
        stranger_arrival_ns_ = arrival_ns;
        if (!is_reopened_ && strangers_ < kRestartFrames) {
            ++counts_.wrong_time;
            return Status::kCorrupt;
        }
        // A clock that went on while the camera was away stays as it is.
        const std::int64_t passed_ns = has_host_clock_ ? std::max(arrival_ns - last_arrival_ns_, std::int64_t{1000})
                                                       : period_ns + time_ns - first_stranger_ns_;
        const std::int64_t step_ns = time_ns + shift_ns_ - last_out_ns_;
        const bool went_on = is_reopened_ && step_ns > 0 &&
                             (!has_host_clock_ || (step_ns < passed_ns + kJump_ns && step_ns > passed_ns - kJump_ns));
        if (!went_on) {
            shift_ns_ = last_out_ns_ + passed_ns - time_ns;
            ++counts_.clock_restarts;
        }
    }
    has_last_ = true;
    is_reopened_ = false;
    strangers_ = 0;
    last_ns_ = time_ns;
    last_arrival_ns_ = arrival_ns;
    last_out_ns_ = time_ns + shift_ns_;
    frame.time_ns = last_out_ns_;
    // A depth time that belongs to another clock is not known.
    const std::int64_t lag_ns = std::max<std::int64_t>(frame.depth_time_ns, 0) - time_ns;
    const bool is_lag_known = frame.depth_time_ns > 0 && lag_ns > -period_ns && lag_ns < period_ns;
    frame.depth_time_ns = is_lag_known ? last_out_ns_ + lag_ns : 0;
    streams_.look(frame);
    if (!streams_.is_frozen()) same_since_ns_ = frame.time_ns;
    frozen_ns_ = frame.time_ns - same_since_ns_;
    return Status::kOk;
}

}  // namespace stillmesh
