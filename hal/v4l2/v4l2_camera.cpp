#include "hal/v4l2/v4l2_camera.hpp"

#include <time.h>

#include <algorithm>
#include <chrono>
#include <exception>
#include <thread>
#include <utility>

#include "hal/calibration/calibration.hpp"
#include "hal/v4l2/pixel_formats.hpp"
#include "hal/v4l2/session.hpp"

namespace stillmesh {
namespace {

using v4l2::Session;

constexpr std::int64_t kRecent_ns = 500'000'000;  // what explains a silence has happened within it

[[nodiscard]] std::int64_t clock_ns(clockid_t clock) noexcept {
    timespec now{};
    static_cast<void>(::clock_gettime(clock, &now));
    return std::int64_t{now.tv_sec} * 1'000'000'000 + now.tv_nsec;
}

// What is added to the monotonic clock to get the time of day: once per process, so that no time jumps.
[[nodiscard]] std::int64_t unix_minus_monotonic_ns() noexcept {
    static const std::int64_t kOffset_ns = clock_ns(CLOCK_REALTIME) - clock_ns(CLOCK_MONOTONIC);
    return kOffset_ns;
}

}  // namespace

V4l2Camera::V4l2Camera(V4l2Options options, std::shared_ptr<V4l2Link> link)
    : options_(std::move(options)), link_(std::move(link)) {
    static_cast<void>(unix_minus_monotonic_ns());
}

V4l2Camera::~V4l2Camera() {
    close();
}

Status V4l2Camera::refuse(Status status, std::string why) {
    message_ = std::move(why);
    return status;
}

Status V4l2Camera::start_session() {
    if (!options_.has_thread) {
        session_->open();
        session_->is_opened = session_->status == Status::kOk;
        return refuse(session_->status, session_->message);
    }
    std::thread([session = session_, begins = options_.thread_begins] { session->serve(begins); }).detach();
    std::unique_lock lock(session_->mutex);
    const bool is_answered = session_->changed.wait_for(lock, std::chrono::milliseconds(options_.open_max_ms),
                                                        [this] { return session_->is_opened || session_->is_closed; });
    if (is_answered) return refuse(session_->status, session_->message);
    session_->is_closing = true;  // whenever it comes back
    return refuse(Status::kUnavailable, "the camera does not answer; unplug it and plug it in again.");
}

Status V4l2Camera::open() noexcept {
    close();
    try {
        if (!options_.calibration.empty() && !has_calibration_) {
            const Status status = load_calibration(options_.calibration, given_, message_);
            if (status != Status::kOk) return Status::kInvalid;
            has_calibration_ = true;
        }
        v4l2::OpeningWishes wishes;
        wishes.device = options_.device;
        wishes.calibration = options_.calibration;
        wishes.given = given_;
        wishes.modes.width_max = options_.width_max;
        wishes.modes.height_max = options_.height_max;
        wishes.modes.has_jpeg = v4l2::has_jpeg();
        wishes.modes.depth_first = depth_first_;
        wishes.modes.colour_first = colour_first_;
        wishes.known = identity_;
        wishes.is_exposure_fixed = options_.is_exposure_fixed;
        wishes.is_registered = options_.is_registered;
        session_ = std::make_shared<Session>(link_, std::move(wishes));
        if (const Status status = start_session(); status != Status::kOk) {
            session_.reset();
            return status;
        }
        adopt();
        return Status::kOk;
    } catch (const std::exception&) {
        close();
        message_ = "the camera cannot be opened: no memory or no thread.";
        return Status::kUnavailable;
    }
}

void V4l2Camera::adopt() {
    const v4l2::Opened& opened = session_->opened;
    identity_ = opened.identity;
    depth_first_ = {opened.cameras.depth.width, opened.cameras.depth.height};
    colour_first_ = {opened.cameras.colour.width, opened.cameras.colour.height};
    device_ = opened.description;
    calibration_source_ = opened.calibration_source;
    notes_ = opened.notes;
    info_ = {};
    info_.model = opened.cameras.colour;
    info_.depth_units_per_m = opened.cameras.depth_units_per_m;
    info_.frames_per_s = opened.frames_per_s;
    info_.readout_s = opened.readout_s;
    conversion_ = std::make_unique<v4l2::FrameConversion>(opened.cameras, session_->opening.colour.format());
    due_ns_ = link_->now_ns();
}

Status V4l2Camera::poll(Frame& frame) noexcept {
    if (session_ == nullptr) return Status::kUnavailable;
    Session& session = *session_;
    if (!options_.has_thread) session.read(0);
    const std::int64_t cpu_ns = clock_ns(CLOCK_THREAD_CPUTIME_ID);
    {
        const std::lock_guard lock(session.mutex);
        if (!session.slot.is_full()) {
            return session.gone_why != nullptr ? refuse(Status::kUnavailable, session.gone_why) : Status::kTimedOut;
        }
        session.given = std::move(session.slot);
        session.slot = {};
    }
    const Session::Pair& given = session.given;  // of this thread alone until it is given back
    Frame made;
    const Status status = conversion_->convert(given.colour.bytes(), given.depth.bytes(),
                                               session.opening.depth.format().bytes_per_line, made, message_);
    if (!session.has_time_shift) {
        session.has_time_shift = true;
        session.time_shift_ns = unix_minus_monotonic_ns() + given.taken_ns - given.colour_us * 1000;
    }
    made.time_ns = given.colour_us * 1000 + session.time_shift_ns;
    made.depth_time_ns = given.depth_us * 1000 + session.time_shift_ns;
    const std::int64_t taken_ns = given.taken_ns;
    {
        const std::lock_guard lock(session.mutex);
        if (status != Status::kOk) session.broken_ns = session.given.complete_ns;
        session.given = {};  // its buffers go back
    }
    poll_cpu_ns_ += clock_ns(CLOCK_THREAD_CPUTIME_ID) - cpu_ns;
    if (status != Status::kOk) return Status::kCorrupt;
    due_ns_ = taken_ns;
    frame = made;
    return Status::kOk;
}

Status V4l2Camera::wait(std::uint32_t timeout_ms) noexcept {
    if (session_ == nullptr) return Status::kUnavailable;
    Session& session = *session_;
    if (!options_.has_thread) {
        session.read(timeout_ms);
        return session.slot.is_full() || session.gone_why != nullptr ? Status::kOk : Status::kTimedOut;
    }
    std::unique_lock lock(session.mutex);
    const bool is_ready = session.changed.wait_for(lock, std::chrono::milliseconds(timeout_ms), [&session] {
        return session.slot.is_full() || session.gone_why != nullptr;
    });
    return is_ready ? Status::kOk : Status::kTimedOut;
}

void V4l2Camera::close() noexcept {
    conversion_.reset();
    if (session_ == nullptr) return;
    if (options_.has_thread) {
        std::unique_lock lock(session_->mutex);
        session_->is_closing = true;
        session_->changed.notify_all();
        // Whoever does not come back keeps the session for itself.
        if (!session_->changed.wait_for(lock, std::chrono::milliseconds(options_.open_max_ms),
                                        [this] { return session_->is_closed; })) {
            message_ = "the camera does not answer; what it holds is left behind.";
        }
    } else {
        session_->close();
    }
    before_ = counts();
    session_.reset();
}

std::int64_t V4l2Camera::next_due_ns() noexcept {
    const auto period_ns = static_cast<std::int64_t>(1e9 / std::max(info_.frames_per_s, 1.0));
    if (session_ == nullptr) return link_->now_ns() + period_ns;
    const std::lock_guard lock(session_->mutex);
    if (session_->slot.is_full()) return session_->slot.complete_ns;  // it waits already
    const std::int64_t next_ns = session_->forecast.next_ns(period_ns);
    return next_ns != 0 ? next_ns : link_->now_ns() + period_ns;
}

std::string V4l2Camera::silence() const {
    if (session_ == nullptr) return {};
    const std::lock_guard lock(session_->mutex);
    if (session_->broken_ns != 0 && link_->now_ns() - session_->broken_ns < kRecent_ns) {
        return "images come, but damaged or cut off";
    }
    const std::int64_t apart_ns = session_->colour_arrival_ns - session_->depth_arrival_ns;
    if (apart_ns > kRecent_ns) return "colour images come, depth images do not";
    if (apart_ns < -kRecent_ns) return "depth images come, colour images do not";
    return {};
}

V4l2Counts V4l2Camera::counts() const noexcept {
    V4l2Counts sum = before_;
    sum.poll_cpu_ns = poll_cpu_ns_;
    if (session_ == nullptr) return sum;
    const std::lock_guard lock(session_->mutex);
    const V4l2Counts& now = session_->counts;
    sum.pairing.add(now.pairing);
    sum.pairing.add(session_->pairer.counts());
    sum.images_colour += now.images_colour;
    sum.images_depth += now.images_depth;
    sum.images_missing += now.images_missing;
    sum.images_broken += now.images_broken;
    sum.dropped += now.dropped;
    sum.reader_cpu_ns += now.reader_cpu_ns;
    return sum;
}

}  // namespace stillmesh
