#include "hal/openni2/openni2_camera.hpp"

#include <OpenNI.h>

#include <algorithm>
#include <chrono>
#include <cmath>
#include <condition_variable>
#include <cstdio>
#include <mutex>
#include <utility>

#include "hal/calibration/calibration.hpp"
#include "hal/openni2/device_choice.hpp"
#include "hal/openni2/image_conversion.hpp"
#include "hal/openni2/openni2_runtime.hpp"
#include "hal/openni2/session.hpp"

namespace stillmesh {
namespace {

using live::monotonic_ns;
using openni2::mode_text;
using openni2::Session;

constexpr double kFocalDefault = 525.0 / 640.0;  // of the width: what the PrimeSense kind has
constexpr std::uint32_t kEndMax_ms = 1500;       // for OpenNI2 to end

}  // namespace

OpenNi2Camera::OpenNi2Camera(OpenNi2Options options)
    : options_(std::move(options)), is_file_(openni2::names_file(options_.device)) {
    static_cast<void>(live::unix_minus_monotonic_ns());
}

OpenNi2Camera::~OpenNi2Camera() {
    close();
    if (runtime_ == nullptr) return;
    // Perhaps this ends OpenNI2: not on this thread.
    struct Shared {
        std::mutex mutex;
        std::condition_variable changed;
        bool is_done = false;
    };
    const auto shared = std::make_shared<Shared>();
    const bool runs = openni2::run_parked([shared, runtime = std::move(runtime_)]() mutable {
        runtime.reset();
        const std::lock_guard lock(shared->mutex);
        shared->is_done = true;
        shared->changed.notify_all();
    });
    std::unique_lock lock(shared->mutex);
    if (runs) {
        // It may hang: OpenNI2 holds its lock while it waits for a driver's thread, which wants that lock to tell of a
        // camera that comes or goes just now.
        static_cast<void>(
            shared->changed.wait_for(lock, std::chrono::milliseconds(std::min(options_.open_max_ms, kEndMax_ms)),
                                     [&shared] { return shared->is_done; }));
    }
}

Status OpenNi2Camera::refuse(Status status, std::string why) {
    message_ = std::move(why);
    close();
    return status;
}

Status OpenNi2Camera::open() noexcept {
    close();
    if (!options_.calibration.empty() && !has_calibration_) {
        const Status status = load_calibration(options_.calibration, given_, message_);
        if (status != Status::kOk) return Status::kInvalid;
        has_calibration_ = true;
    }
    const auto session = std::make_shared<Session>();
    session->is_file = is_file_;
    session->identity = {.uri = uri_, .serial = serial_};
    if (first_width_ != 0) session->streams.width_first = first_width_;
    if (!openni2::run_parked([session, options = options_] { session->serve(options); })) {
        message_ = "the system has no thread left for the camera.";
        return Status::kUnavailable;
    }
    if (!session->answers_within(options_.open_max_ms)) {
        message_ = "the camera's driver does not answer; unplug the camera and plug it in again.";
        return Status::kUnavailable;
    }
    message_ = session->message;
    if (session->status != Status::kOk) {
        if (session->runtime != nullptr) runtime_ = std::move(session->runtime);
        return session->status;
    }
    runtime_ = session->runtime;
    session_ = session;
    uri_ = session->identity.uri;
    serial_ = session->identity.serial;
    notes_ = session->streams.notes;
    frames_expected_ =
        session->is_file
            ? static_cast<std::uint64_t>(std::min(session->streams.colour_images, session->streams.depth_images))
            : 0;
    info_ = {};
    info_.model.width = static_cast<std::uint32_t>(session->streams.colour_mode.getResolutionX());
    info_.model.height = static_cast<std::uint32_t>(session->streams.colour_mode.getResolutionY());
    if (first_width_ == 0) first_width_ = session->streams.colour_mode.getResolutionX();
    info_.frames_per_s = std::max(session->streams.colour_mode.getFps(), 1);
    info_.depth_units_per_m =
        session->streams.depth_mode.getPixelFormat() == openni::PIXEL_FORMAT_DEPTH_100_UM ? 10000.0 : 1000.0;
    if (const Status status = calibrate(session->streams.fov_x); status != Status::kOk) return status;
    if (const std::string why = session->is_file ? why_nothing_comes() : std::string(); !why.empty()) {
        return refuse(Status::kInvalid, session->description + ": " + why);
    }
    conversion_ = std::make_unique<openni2::ImageConversion>(session->streams, info_, options_.baseline_m);
    if (!session->streams.is_registered) {
        char text[160];
        std::snprintf(text, sizeof(text),
                      "depth is registered to colour here, with a baseline of %.0f mm; a calibrated camera does it "
                      "better.",
                      1e3 * options_.baseline_m);
        notes_.emplace_back(text);
    }
    device_ = session->description + ", " + mode_text(session->streams.colour_mode) + ", depth " +
              (session->is_file && options_.registration == Registration::kAuto ? "taken as registered"
               : session->streams.is_registered
                   ? (options_.registration == Registration::kNone ? "taken as registered" : "registered by the camera")
                   : "registered here");
    due_ns_ = monotonic_ns();
    return Status::kOk;
}

std::string OpenNi2Camera::why_nothing_comes() {
    Session& session = *session_;
    std::unique_lock lock(session.mutex);
    static_cast<void>(session.changed.wait_for(lock, std::chrono::milliseconds(options_.open_max_ms),
                                               [&session] { return session.slot || session.has_ended; }));
    if (session.slot) return {};
    return "OpenNI2's player gives " + std::to_string(session.counts.images_colour) + " colour and " +
           std::to_string(session.counts.images_depth) +
           " depth images of it, and no two of the same time; record it again, with 'stillmesh capture' or NiViewer.";
}

Status OpenNi2Camera::calibrate(double fov_x) {
    CameraModel& model = info_.model;
    if (!has_calibration_) {
        const bool is_known = std::isfinite(fov_x) && fov_x > 0.3 && fov_x < 2.5;
        model.fx = model.fy = is_known ? model.width / (2.0 * std::tan(0.5 * fov_x)) : kFocalDefault * model.width;
        model.cx = (model.width - 1) / 2.0;
        model.cy = (model.height - 1) / 2.0;
        calibration_source_ =
            is_known ? "the camera's field of view" : "the default of its kind (no field of view given)";
        return Status::kOk;
    }
    CameraModel given = given_.model;
    if (given.width == 0) given.width = model.width;
    if (given.height == 0) given.height = model.height;
    if (std::uint64_t{given.width} * model.height != std::uint64_t{given.height} * model.width) {
        return refuse(Status::kInvalid, options_.calibration + ": is for " + std::to_string(given.width) + "x" +
                                            std::to_string(given.height) + " pixels, the camera gives " +
                                            std::to_string(model.width) + "x" + std::to_string(model.height) + ".");
    }
    const double scale = static_cast<double>(model.width) / given.width;
    given.fx *= scale;
    given.fy *= scale;
    given.cx = (given.cx + 0.5) * scale - 0.5;
    given.cy = (given.cy + 0.5) * scale - 0.5;
    given.width = model.width;
    given.height = model.height;
    model = given;
    info_.readout_s = given_.readout_s;
    calibration_source_ = options_.calibration;
    return Status::kOk;
}

Status OpenNi2Camera::poll(Frame& frame) noexcept {
    if (session_ == nullptr) return Status::kUnavailable;
    const live::CpuMeter meter(before_.poll_cpu_ns);
    Session& session = *session_;
    if (session.is_file) {
        std::unique_lock lock(session.mutex);
        static_cast<void>(session.changed.wait_for(lock, std::chrono::milliseconds(options_.open_max_ms),
                                                   [&session] { return session.slot || session.has_ended; }));
        if (!session.slot && session.has_ended) {
            message_ = session.description + ": has ended.";
            return Status::kEnd;
        }
    }
    static_cast<void>(session.take_back());
    if (const Status status = session.take(message_); status != Status::kOk) return status;
    const Session::Pair& given = *session.given;  // of this thread alone until the next poll
    const auto has_form = [](const openni::VideoFrameRef& image, const openni::VideoMode& mode) {
        const auto bytes = static_cast<int>(mode.getPixelFormat() == openni::PIXEL_FORMAT_DEPTH_1_MM
                                                ? 2
                                                : openni2::bytes_per_pixel(mode.getPixelFormat()));
        return image.getWidth() == mode.getResolutionX() && image.getHeight() == mode.getResolutionY() &&
               image.getVideoMode().getPixelFormat() == mode.getPixelFormat() && image.getData() != nullptr &&
               image.getStrideInBytes() >= image.getWidth() * bytes && image.getStrideInBytes() % 2 == 0 &&
               static_cast<std::int64_t>(image.getDataSize()) >=
                   std::int64_t{image.getStrideInBytes()} * (image.getHeight() - 1) + image.getWidth() * bytes;
    };
    if (!has_form(given.colour, session.streams.colour_mode) || !has_form(given.depth, session.streams.depth_mode)) {
        message_ = "an image that is damaged, or of another size or format than " +
                   mode_text(session.streams.colour_mode) + ".";
        const std::lock_guard lock(session.mutex);
        session.unusable_ns = given.complete_ns;
        return Status::kCorrupt;
    }
    frame = {};
    if (session.is_file) {
        frame.time_ns = given.colour_us * 1000;
        frame.depth_time_ns = given.depth_us * 1000;
    } else {
        session.time_of_day.begin(given.colour_us, given.taken_ns);
        frame.time_ns = session.time_of_day.unix_ns(given.colour_us);
        frame.depth_time_ns = session.time_of_day.unix_ns(given.depth_us);
    }
    frame.depth_units_per_m = info_.depth_units_per_m;
    frame.colour = {static_cast<const std::uint8_t*>(given.colour.getData()), info_.model.width, info_.model.height,
                    static_cast<std::size_t>(given.colour.getStrideInBytes())};
    frame.depth = {static_cast<const std::uint16_t*>(given.depth.getData()),
                   static_cast<std::uint32_t>(given.depth.getWidth()),
                   static_cast<std::uint32_t>(given.depth.getHeight()),
                   static_cast<std::size_t>(given.depth.getStrideInBytes()) / 2};
    due_ns_ = given.taken_ns;
    conversion_->convert(frame);
    return Status::kOk;
}

Status OpenNi2Camera::wait(std::uint32_t timeout_ms) noexcept {
    if (session_ == nullptr) return Status::kUnavailable;
    return is_file_ ? Status::kOk : session_->wait(timeout_ms);
}

std::int64_t OpenNi2Camera::next_due_ns() noexcept {
    return session_ != nullptr ? session_->next_due_ns(monotonic_ns()) : monotonic_ns() + period_ns();
}

std::string OpenNi2Camera::silence() const {
    if (session_ == nullptr) return {};
    const std::lock_guard lock(session_->mutex);
    if (session_->has_unusable(monotonic_ns())) {
        return "images come, but of another size or format than " + mode_text(session_->streams.colour_mode);
    }
    return session_->silent_stream();
}

std::optional<std::string> OpenNi2Camera::usb_place() const {
    return uri_.empty() ? std::nullopt : std::optional(uri_);
}

LiveCounts OpenNi2Camera::counts() const noexcept {
    LiveCounts sum = before_;
    if (session_ != nullptr) sum.add(session_->counted());
    return sum;
}

void OpenNi2Camera::close() noexcept {
    if (session_ == nullptr) return;
    conversion_.reset();
    if (!session_->closes_within(options_.open_max_ms)) {
        message_ = "the camera's driver does not answer; what it holds is left behind.";
    }
    before_ = counts();
    session_.reset();
}

}  // namespace stillmesh
