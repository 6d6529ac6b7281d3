#include "hal/ros2/ros2_camera.hpp"

#include <exception>
#include <utility>

#include "hal/calibration/calibration.hpp"
#include "hal/ros2/ros_image_session.hpp"

namespace stillmesh {
namespace {

using live::monotonic_ns;

constexpr const char* kRemedy =
    "give the topic of depth that is aligned to colour (realsense: align_depth.enable:=true, "
    "/camera/aligned_depth_to_color/image_raw), or both cameras (--calibration FILE).";

[[nodiscard]] std::string size_text(const ImageSize& size) {
    return std::to_string(size.width) + "x" + std::to_string(size.height);
}

}  // namespace

Ros2Camera::Ros2Camera(Ros2Options options) : options_(std::move(options)) {}

Ros2Camera::~Ros2Camera() {
    close();
}

Status Ros2Camera::refuse(Status status, std::string why) {
    message_ = std::move(why);
    return status;
}

Status Ros2Camera::open() noexcept {
    close();
    try {
        const Status status = begin();
        if (status != Status::kOk) session_.reset();
        return status;
    } catch (const std::exception&) {
        session_.reset();
        message_ = "ROS 2's images cannot be had: no memory or no thread.";
        return Status::kUnavailable;
    }
}

Status Ros2Camera::begin() {
    std::string why;
    if (context_ == nullptr) context_ = RosContext::get(why);
    if (context_ == nullptr) return refuse(Status::kInvalid, why);
    info_ = {};
    if (!options_.calibration.empty() && load_calibration(options_.calibration, info_, why) != Status::kOk) {
        return refuse(Status::kInvalid, why);
    }
    session_ = std::make_unique<Session>(options_);
    Session& session = *session_;
    if (!session.subscribe(*context_, why)) return refuse(Status::kInvalid, why);
    std::unique_lock lock(session.mutex);
    const auto until = std::chrono::steady_clock::now() + std::chrono::milliseconds(options_.open_max_ms);
    const bool needs_lens = options_.calibration.empty();
    const auto is_there = [&] { return session.slot && (session.has_lens || !needs_lens); };
    static_cast<void>(session.changed.wait_until(lock, until, [&] { return is_there() || !session.problem.empty(); }));
    if (!is_there()) {
        if (!session.problem.empty()) return refuse(Status::kInvalid, session.problem);
        const std::string quiet = session.silent();
        lock.unlock();
        const std::string nobody = session.unmatched();
        if (!nobody.empty()) {
            return refuse(Status::kUnavailable, "nobody publishes " + nobody +
                                                    ": is the driver running, with this ROS_DOMAIN_ID? Other topics: "
                                                    "--camera ros2:COLOUR,DEPTH,INFO.");
        }
        return refuse(Status::kUnavailable, quiet.empty() ? "no colour image of ROS 2 has a depth image of its time."
                                                          : "nothing comes on " + quiet);
    }
    if (needs_lens) info_ = session.lens;
    const ImageSize colour{session.slot->colour->width, session.slot->colour->height};
    CameraModel& model = info_.model;
    if (model.width == 0 && model.height == 0) model.width = colour.width, model.height = colour.height;
    if (model.width != colour.width || model.height != colour.height) {
        return refuse(Status::kInvalid, (needs_lens ? options_.info : options_.calibration) + " is for " +
                                            size_text({model.width, model.height}) + ", " + options_.colour + " is " +
                                            size_text(colour) + ".");
    }
    info_.depth_units_per_m = session.slot->depth->units_per_m;
    info_.frames_per_s = 1e6 / static_cast<double>(session.period_us);
    return place_depth(lock, std::chrono::steady_clock::now() + std::chrono::milliseconds(options_.open_max_ms));
}

// As for bags: images of one frame are of one view; else two cameras that see the same picture are; else the transform
// between the frames says where depth is.
Status Ros2Camera::place_depth(std::unique_lock<std::mutex>& lock, std::chrono::steady_clock::time_point until) {
    Session& session = *session_;
    const ImageSize colour{info_.model.width, info_.model.height};
    const ImageSize depth{session.slot->depth->width, session.slot->depth->height};
    const std::string frame = session.frame_ids[Session::kDepth];
    const std::string colour_frame = session.frame_ids[Session::kColour];
    const auto is_of_depth = [&](const CameraModel& model) { return ImageSize{model.width, model.height} == depth; };
    std::optional<SeparateDepth> separate = std::exchange(info_.separate_depth, std::nullopt);
    if (separate && is_of_depth(separate->model)) {
        return register_here(*separate, "the depth camera in " + options_.calibration);
    }
    if (depth == colour && frame == colour_frame) return refuse(Status::kOk, "");
    const std::string& lens = session.names[Session::kDepthLens];
    const bool is_asked = session.readers[Session::kDepthLens] > 0;
    if (is_asked) session.changed.wait_until(lock, until, [&] { return session.has_depth_lens; });
    const CameraModel& model = session.depth_lens.model;
    // Of a topic that nobody publishes silence is an answer.
    if (is_asked && !session.has_depth_lens && session.is_matched(Session::kDepthLens)) {
        return refuse(Status::kUnavailable, "nothing comes on " + lens + ", which says what camera depth is of");
    }
    if (!session.has_depth_lens || !is_of_depth(model)) {
        if (depth != colour || session.has_depth_lens) {
            return refuse(Status::kInvalid, options_.depth + " is " + size_text(depth) + ", " + options_.colour +
                                                " is " + size_text(colour) +
                                                (is_asked ? ", and no " + lens + " is of it: " : ": ") + kRemedy);
        }
        if (is_asked) {
            notes_.push_back("depth is in frame '" + frame + "', colour in '" + colour_frame + "', and no " + lens +
                             " says how they lie: taken for the same view.");
        }
        return refuse(Status::kOk, "");
    }
    if (is_same_view(model, info_.model)) {
        return depth == colour ? refuse(Status::kOk, "") : register_here({model, {}}, lens);
    }
    std::optional<RigidTransform> pose;
    static_cast<void>(session.changed.wait_until(
        lock, until, [&] { return (pose = session.frames.tree().between(frame, colour_frame)).has_value(); }));
    if (!pose) {
        return refuse(Status::kUnavailable, options_.depth + " is of another camera than " + options_.colour +
                                                ", and " + session.frames.told_by() + " does not say how '" + frame +
                                                "' lies to '" + colour_frame + "': " + kRemedy);
    }
    return register_here({model, *pose}, lens + " and " + session.frames.told_by());
}

Status Ros2Camera::register_here(const SeparateDepth& depth, const std::string& source) {
    registration_.emplace(depth.model, info_.model, depth.colour_from_depth, info_.depth_units_per_m);
    registered_.resize(std::size_t{info_.model.width} * info_.model.height);
    depth_size_ = {depth.model.width, depth.model.height};
    notes_.push_back("depth is of a camera of its own (" + source + "): registered to colour here.");
    return refuse(Status::kOk, "");
}

Status Ros2Camera::poll(Frame& frame) noexcept {
    if (session_ == nullptr) return Status::kUnavailable;
    const live::CpuMeter meter(before_.poll_cpu_ns);
    Session& session = *session_;
    if (session.take(message_) != Status::kOk) {
        if (session.is_matched(Session::kColour) && session.is_matched(Session::kDepth)) return Status::kTimedOut;
        return refuse(Status::kUnavailable, "nobody publishes " + session.unmatched() + " any more");
    }
    // What is given is nobody else's until the next poll.
    const RosPixels& colour = *session.given->colour;
    const RosPixels& depth = *session.given->depth;
    due_ns_ = session.given->taken_ns;
    frame.time_ns = colour.time_ns;
    frame.depth_time_ns = depth.time_ns;
    frame.format = colour.format;
    frame.colour = {colour.colour.data(), colour.width, colour.height,
                    std::size_t{channels_of(colour.format)} * colour.width};
    frame.depth = {depth.depth.data(), depth.width, depth.height, depth.width};
    frame.depth_units_per_m = depth.units_per_m;
    if (!registration_) return Status::kOk;
    if (ImageSize{depth.width, depth.height} != depth_size_ || depth.units_per_m != info_.depth_units_per_m) {
        return Status::kCorrupt;
    }
    registration_->reproject(frame.depth, registered_.data());
    frame.depth = {registered_.data(), info_.model.width, info_.model.height, info_.model.width};
    return Status::kOk;
}

Status Ros2Camera::wait(std::uint32_t timeout_ms) noexcept {
    return session_ != nullptr ? session_->wait(timeout_ms) : Status::kUnavailable;
}

void Ros2Camera::close() noexcept {
    registration_.reset();
    notes_.clear();
    if (session_ == nullptr) return;
    before_ = counts();
    session_.reset();
}

std::int64_t Ros2Camera::next_due_ns() noexcept {
    return session_ != nullptr ? session_->next_due_ns(monotonic_ns()) : monotonic_ns() + period_ns();
}

std::string Ros2Camera::silence() const {
    if (session_ == nullptr) return {};
    const std::lock_guard lock(session_->mutex);
    const std::string quiet = session_->silent();
    return quiet.empty() ? quiet : "nothing comes on " + quiet;
}

std::string Ros2Camera::device() const {
    return "ROS 2 topics " + options_.colour + " and " + options_.depth + ", " + std::to_string(info_.model.width) +
           "x" + std::to_string(info_.model.height) + "@" + std::to_string(static_cast<int>(info_.frames_per_s + 0.5)) +
           (registration_ ? ", registered here" : "");
}

std::string Ros2Camera::calibration_source() const {
    return options_.calibration.empty() ? options_.info : options_.calibration;
}

LiveCounts Ros2Camera::counts() const noexcept {
    LiveCounts sum = before_;
    if (session_ != nullptr) sum.add(session_->counted());
    return sum;
}

}  // namespace stillmesh
