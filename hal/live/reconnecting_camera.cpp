#include "hal/live/reconnecting_camera.hpp"

#include <algorithm>
#include <cstdio>
#include <utility>

namespace stillmesh {
namespace {

// So many images of another form in a row are another mode, not an accident.
constexpr std::uint32_t kWrongFormsMax = 10;
// Between two polls: whoever lets more time pass has not listened meanwhile.
constexpr std::int64_t kUnheard_ns = 250'000'000;

[[nodiscard]] std::string seconds(std::int64_t ns) {
    char text[32];
    std::snprintf(text, sizeof(text), "%.1f s", static_cast<double>(ns) * 1e-9);
    return text;
}

}  // namespace

ReconnectingCamera::ReconnectingCamera(DepthCamera& source, ReconnectOptions options)
    : source_(source), options_(std::move(options)), guard_(CameraInfo{}, options_.is_live) {
    news_.reserve(kNewsMax);
}

Status ReconnectingCamera::open() noexcept {
    close();
    const Status status = source_.open();
    if (status != Status::kOk) return status;
    is_open_ = true;
    life_ = CameraLife::kStreaming;
    info_ = source_.info();
    guard_ = FrameGuard(info_, options_.is_live);
    counts_ = {};
    news_.clear();
    last_frame_ns_ = quiet_since_ns_ = last_poll_ns_ = options_.now_ns();
    stall_after_ns_ = options_.stall_ns;
    is_disturbed_ = false;
    wrong_in_a_row_ = 0;
    return Status::kOk;
}

void ReconnectingCamera::close() noexcept {
    if (is_open_) source_.close();
    is_open_ = false;
    life_ = CameraLife::kClosed;
}

bool ReconnectingCamera::is_same_camera() const noexcept {
    const CameraInfo& now = source_.info();
    return now.model == info_.model && now.depth_units_per_m == info_.depth_units_per_m;
}

void ReconnectingCamera::tell(std::string sentence) {
    if (news_.size() < kNewsMax) news_.push_back(std::move(sentence));
}

std::string ReconnectingCamera::take_news() {
    if (news_.empty()) return options_.remark ? options_.remark() : std::string();
    std::string first = std::move(news_.front());
    news_.erase(news_.begin());
    return first;
}

void ReconnectingCamera::lost(std::int64_t now_ns) {
    ++counts_.unplugs;
    std::string why = options_.source_message ? options_.source_message() : std::string();
    tell("the camera is gone" + (why.empty() ? std::string() : " (" + why + ")") +
         ": no poses until it is back; the map stays.");
    source_.close();
    is_open_ = false;
    is_disturbed_ = true;
    life_ = CameraLife::kAway;
    retry_ns_ = options_.retry_first_ns;
    next_try_ns_ = now_ns + retry_ns_;
}

void ReconnectingCamera::stalled(std::int64_t now_ns, const char* why) {
    ++counts_.stalls;
    const std::string known = options_.silence ? options_.silence() : std::string();
    source_.close();  // a reset is for a device that nobody uses
    is_open_ = false;
    const bool is_reset = options_.reset && options_.reset();
    tell(std::string(why) + " for " + seconds(now_ns - last_frame_ns_) + (known.empty() ? "" : " (" + known + ")") +
         ": the camera is " + (is_reset ? "reset and " : "") + "opened again.");
    is_disturbed_ = true;
    wrong_in_a_row_ = 0;
    life_ = CameraLife::kSilent;
    stall_after_ns_ = std::min(2 * stall_after_ns_, options_.stall_max_ns);
    retry_ns_ = options_.retry_first_ns;
    next_try_ns_ = now_ns;
}

void ReconnectingCamera::open_again(std::int64_t now_ns) {
    const Status status = source_.open();
    const std::int64_t end_ns = options_.now_ns();
    counts_.reopen_longest_ns = std::max(counts_.reopen_longest_ns, end_ns - now_ns);
    if (status == Status::kOk && is_same_camera()) {
        is_open_ = true;
        life_ = CameraLife::kSilent;
        quiet_since_ns_ = last_poll_ns_ = end_ns;
        guard_.reopened();
        return;
    }
    std::string refusal;
    if (status == Status::kOk) {
        const CameraModel& model = source_.info().model;
        char text[160];
        std::snprintf(text, sizeof(text),
                      "a camera is there, but not as before (%ux%u instead of %ux%u, or other intrinsics): not used; "
                      "plug the old one in, or start again.",
                      model.width, model.height, info_.model.width, info_.model.height);
        refusal = text;
        source_.close();
    } else if (status != Status::kUnavailable && options_.source_message) {
        refusal = options_.source_message();
    }
    if (!refusal.empty() && refusal != last_refusal_) tell(last_refusal_ = refusal);
    life_ = CameraLife::kAway;
    next_try_ns_ = end_ns + retry_ns_;
    retry_ns_ = std::min(2 * retry_ns_, options_.retry_max_ns);
}

void ReconnectingCamera::delivered(std::int64_t now_ns) {
    if (is_disturbed_) {
        const std::int64_t away_ns = now_ns - last_frame_ns_;
        ++counts_.returns;
        counts_.away_ns += away_ns;
        counts_.away_longest_ns = std::max(counts_.away_longest_ns, away_ns);
        tell("the camera is back after " + seconds(away_ns) + ".");
        is_disturbed_ = false;
        last_refusal_.clear();
    }
    life_ = CameraLife::kStreaming;
    last_frame_ns_ = quiet_since_ns_ = now_ns;
    stall_after_ns_ = options_.stall_ns;
    wrong_in_a_row_ = 0;
}

Status ReconnectingCamera::poll(Frame& frame) noexcept {
    if (life_ == CameraLife::kClosed) return Status::kUnavailable;
    const std::int64_t now_ns = options_.now_ns();
    if (now_ns - last_poll_ns_ > kUnheard_ns) quiet_since_ns_ += now_ns - last_poll_ns_;
    last_poll_ns_ = now_ns;
    if (!is_open_) {
        if (now_ns < next_try_ns_) return Status::kTimedOut;
        open_again(now_ns);
        if (!is_open_) return Status::kTimedOut;
    }
    Frame polled;
    switch (source_.poll(polled)) {
        case Status::kOk: {
            const Status admitted = guard_.admit(polled, now_ns);
            if (admitted == Status::kInvalid && ++wrong_in_a_row_ >= kWrongFormsMax) {
                stalled(now_ns, "images of another size or format");
            }
            if (admitted != Status::kOk) break;
            if (guard_.frozen_ns() > options_.stall_ns) {
                stalled(now_ns, "the same image again and again");
                break;
            }
            delivered(now_ns);
            frame = polled;
            return Status::kOk;
        }
        case Status::kEnd: return Status::kEnd;
        case Status::kUnavailable: lost(now_ns); break;
        case Status::kTimedOut: break;
        default: ++counts_.bad_polls; break;
    }
    if (is_open_ && now_ns - quiet_since_ns_ > stall_after_ns_) stalled(now_ns, "no frames");
    return Status::kTimedOut;
}

Status ReconnectingCamera::wait(std::uint32_t timeout_ms) noexcept {
    if (is_open_) return source_.wait(timeout_ms);
    const std::int64_t now_ns = options_.now_ns();
    const std::int64_t until_ns = now_ns + std::int64_t{timeout_ms} * 1'000'000;
    if (life_ == CameraLife::kClosed) return Status::kUnavailable;
    options_.sleep_until_ns(std::min(until_ns, std::max(next_try_ns_, now_ns)));
    return until_ns < next_try_ns_ ? Status::kTimedOut : Status::kOk;
}

std::int64_t ReconnectingCamera::due_ns() const noexcept {
    return options_.times != nullptr ? options_.times->due_ns() : last_frame_ns_;
}

std::int64_t ReconnectingCamera::next_due_ns() noexcept {
    if (options_.times != nullptr) return options_.times->next_due_ns();
    return last_frame_ns_ + static_cast<std::int64_t>(1e9 / std::max(info_.frames_per_s, 1.0));
}

std::uint64_t ReconnectingCamera::dropped() noexcept {
    return options_.times != nullptr ? options_.times->dropped() : 0;
}

}  // namespace stillmesh
