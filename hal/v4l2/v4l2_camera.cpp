#include "hal/v4l2/v4l2_camera.hpp"

#include <exception>
#include <thread>
#include <utility>

#include "hal/calibration/calibration.hpp"
#include "hal/v4l2/pixel_formats.hpp"
#include "hal/v4l2/session.hpp"

namespace stillmesh {

using v4l2::Session;

V4l2Camera::V4l2Camera(V4l2Options options, std::shared_ptr<V4l2Link> link)
    : options_(std::move(options)), link_(std::move(link)) {
    static_cast<void>(live::unix_minus_monotonic_ns());
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
    if (session_->answers_within(options_.open_max_ms)) return refuse(session_->status, session_->message);
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
    info_.is_depth_older = opened.is_alternating;
    conversion_ = std::make_unique<v4l2::FrameConversion>(opened.cameras, session_->opening.colour.format());
    due_ns_ = link_->now_ns();
}

Status V4l2Camera::poll(Frame& frame) noexcept {
    if (session_ == nullptr) return Status::kUnavailable;
    Session& session = *session_;
    if (!options_.has_thread) session.read(0);
    const live::CpuMeter meter(before_.poll_cpu_ns);
    if (const Status status = session.take(message_); status != Status::kOk) return status;
    const Session::Pair& given = *session.given;
    Frame made;
    const Status status = conversion_->convert(given.colour.bytes(), given.depth.bytes(),
                                               session.opening.depth.format().bytes_per_line, made, message_);
    session.time_of_day.begin(given.colour_us, given.taken_ns);
    made.time_ns = session.time_of_day.unix_ns(given.colour_us);
    made.depth_time_ns = session.time_of_day.unix_ns(given.depth_us);
    const std::int64_t taken_ns = given.taken_ns;
    {
        const std::lock_guard lock(session.mutex);
        if (status != Status::kOk) session.unusable_ns = given.complete_ns;
        session.given.reset();  // its buffers go back
    }
    if (status != Status::kOk) return Status::kCorrupt;
    due_ns_ = taken_ns;
    frame = made;
    return Status::kOk;
}

Status V4l2Camera::wait(std::uint32_t timeout_ms) noexcept {
    if (session_ == nullptr) return Status::kUnavailable;
    if (!options_.has_thread) session_->read(timeout_ms);
    return session_->wait(options_.has_thread ? timeout_ms : 0);
}

void V4l2Camera::close() noexcept {
    conversion_.reset();
    if (session_ == nullptr) return;
    if (!options_.has_thread) {
        session_->close();
    } else if (!session_->closes_within(options_.open_max_ms)) {
        message_ = "the camera does not answer; what it holds is left behind.";
    }
    before_ = counts();
    session_.reset();
}

std::int64_t V4l2Camera::next_due_ns() noexcept {
    return session_ != nullptr ? session_->next_due_ns(link_->now_ns()) : link_->now_ns() + period_ns();
}

std::string V4l2Camera::silence() const {
    if (session_ == nullptr) return {};
    const std::lock_guard lock(session_->mutex);
    if (session_->has_unusable(link_->now_ns())) return "images come, but damaged or cut off";
    return session_->silent_stream();
}

std::string V4l2Camera::remark() {
    if (session_ == nullptr) return {};
    const std::lock_guard lock(session_->mutex);
    std::string sentence = session_->take_remark();
    // Another opening says it again.
    if (sentence.empty() || sentence == told_) return {};
    return told_ = std::move(sentence);
}

std::optional<std::string> V4l2Camera::usb_place() const {
    return identity_.usb_port.empty() ? std::nullopt : std::optional(identity_.usb_port);
}

LiveCounts V4l2Camera::counts() const noexcept {
    LiveCounts sum = before_;
    if (session_ != nullptr) sum.add(session_->counted());
    return sum;
}

}  // namespace stillmesh
