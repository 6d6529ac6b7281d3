#include "hal/freenect/freenect_camera.hpp"

#include <libfreenect.h>

#include <array>
#include <exception>
#include <thread>
#include <utility>

#include "hal/calibration/calibration.hpp"
#include "hal/live/live_session.hpp"

namespace stillmesh {
namespace {

using live::monotonic_ns;

constexpr std::size_t kPixels = std::size_t{FreenectCamera::kWidth} * FreenectCamera::kHeight;
constexpr std::int64_t kPeriod_us = 33'333;
constexpr std::uint32_t kTicksPerUs = 60;  // of the Kinect's timestamps, which wrap after 71 s
constexpr std::uint32_t kRawValues = 2048;

// One image being written by libfreenect, one waiting for its partner, one in the slot, one given out.
constexpr std::uint32_t kBuffers = 4;

// The images of one kind and who has which.
template <typename Pixel>
struct Buffers {
    std::array<std::vector<Pixel>, kBuffers> images;
    std::uint32_t taken = 0;  // a bit each
};

// One of them, given back when it goes out of use.
template <typename Pixel>
class Taken {
public:
    Taken() = default;
    static Taken take(Buffers<Pixel>& buffers) {
        Taken taken;
        for (std::uint32_t i = 0; i < kBuffers; ++i) {
            if ((buffers.taken >> i & 1U) != 0) continue;
            buffers.taken |= 1U << i;
            taken.buffers_ = &buffers;
            taken.index_ = i;
            break;
        }
        STILLMESH_CHECK(taken.buffers_ != nullptr);  // there are as many as places to be in
        return taken;
    }
    Taken(Taken&& other) noexcept : buffers_(std::exchange(other.buffers_, nullptr)), index_(other.index_) {}
    Taken& operator=(Taken&& other) noexcept {
        if (this != &other) {
            release();
            buffers_ = std::exchange(other.buffers_, nullptr);
            index_ = other.index_;
        }
        return *this;
    }
    Taken(const Taken&) = delete;
    Taken& operator=(const Taken&) = delete;
    ~Taken() { release(); }

    void release() noexcept {
        if (buffers_ != nullptr) buffers_->taken &= ~(1U << index_);
        buffers_ = nullptr;
    }
    [[nodiscard]] bool is_held() const noexcept { return buffers_ != nullptr; }
    [[nodiscard]] Pixel* pixels() const noexcept { return buffers_->images[index_].data(); }

private:
    Buffers<Pixel>* buffers_ = nullptr;
    std::uint32_t index_ = 0;
};

// An image of either kind: the pairer keeps one type.
struct Image {
    Taken<std::uint8_t> colour;
    Taken<std::uint16_t> depth;
};

}  // namespace

std::uint16_t kinect_millimetres(std::uint16_t raw) noexcept {
    // Triangulation against the reference pattern: how far a dot is shifted in the infrared camera's image, as depth
    // values count it (four to a step, 800 at the reference), scaled to the reference's plane. Every Kinect reports the
    // same constants (libfreenect's zero plane): reference at 1200 mm, emitter 75 mm beside the camera, 1.042 mm a
    // step.
    constexpr double kReference_mm = 1200;
    constexpr double kEmitter_mm = 75;
    constexpr double kStep_mm = 1.042;
    if (raw >= kRawValues - 1) return 0;
    const double shift_mm = ((static_cast<double>(raw) - 800) / 4 - 0.375) * kStep_mm;
    if (shift_mm >= kEmitter_mm) return 0;
    const double depth_mm = kReference_mm * kEmitter_mm / (kEmitter_mm - shift_mm);
    return depth_mm >= 400 && depth_mm <= FREENECT_DEPTH_MM_MAX_VALUE ? static_cast<std::uint16_t>(depth_mm)
                                                                      : std::uint16_t{0};
}

struct FreenectCamera::Session : live::LiveSession<Image> {
    FreenectOptions options;
    std::string message;
    bool is_registered = false;
    Buffers<std::uint8_t> colour_buffers;  // these and all below: under the mutex
    Buffers<std::uint16_t> depth_buffers;
    Taken<std::uint8_t> colour_writing;  // by libfreenect
    Taken<std::uint16_t> depth_writing;
    bool has_stamp = false;
    std::uint32_t last_stamp = 0;
    std::int64_t ticks = 0;
    std::int64_t last_image_ns = 0;

    explicit Session(FreenectOptions given_options) : options(std::move(given_options)) {
        for (auto& image : colour_buffers.images) image.resize(kPixels * 3);
        for (auto& image : depth_buffers.images) image.resize(kPixels);
    }
    ~Session() { release_images(); }  // into buffers that are still there
    Session(const Session&) = delete;
    Session& operator=(const Session&) = delete;

    // Opens, reads until it is told to close, closes: all on one thread, the only one that calls libfreenect.
    void serve() noexcept;

private:
    [[nodiscard]] bool start(freenect_context* context, freenect_device*& device);
    [[nodiscard]] bool start_streams(freenect_device* device);
    void read(freenect_context* context);
    [[nodiscard]] bool refuse(const char* why) {
        message = why;
        return false;
    }
    static void on_colour(freenect_device* device, void* pixels, std::uint32_t stamp);
    static void on_depth(freenect_device* device, void* pixels, std::uint32_t stamp);
    [[nodiscard]] std::int64_t time_us(std::uint32_t stamp) noexcept;
    void take_in(bool is_colour, Image image, std::uint32_t stamp);
};

// Both streams are stamped by one clock, and arrive nearly in order: the shorter way round is the right one.
std::int64_t FreenectCamera::Session::time_us(std::uint32_t stamp) noexcept {
    if (!has_stamp) {
        has_stamp = true;
        ticks = std::int64_t{1} << 32U;  // what comes a little before stays positive
    } else {
        ticks += static_cast<std::int32_t>(stamp - last_stamp);
    }
    last_stamp = stamp;
    return ticks / kTicksPerUs;
}

void FreenectCamera::Session::take_in(bool is_colour, Image image, std::uint32_t stamp) {
    last_image_ns = monotonic_ns();
    bool is_pair = false;
    static_cast<void>(add(is_colour, std::move(image), time_us(stamp), last_image_ns, is_pair));
}

void FreenectCamera::Session::on_colour(freenect_device* device, void*, std::uint32_t stamp) {
    Session& session = *static_cast<Session*>(freenect_get_user(device));
    const std::lock_guard lock(session.mutex);
    Image image;
    image.colour = std::move(session.colour_writing);
    session.take_in(true, std::move(image), stamp);
    session.colour_writing = Taken<std::uint8_t>::take(session.colour_buffers);
    static_cast<void>(freenect_set_video_buffer(device, session.colour_writing.pixels()));
}

void FreenectCamera::Session::on_depth(freenect_device* device, void*, std::uint32_t stamp) {
    Session& session = *static_cast<Session*>(freenect_get_user(device));
    const std::lock_guard lock(session.mutex);
    Image image;
    image.depth = std::move(session.depth_writing);
    session.take_in(false, std::move(image), stamp);
    session.depth_writing = Taken<std::uint16_t>::take(session.depth_buffers);
    static_cast<void>(freenect_set_depth_buffer(device, session.depth_writing.pixels()));
}

bool FreenectCamera::Session::start(freenect_context* context, freenect_device*& device) {
    freenect_set_log_level(context, FREENECT_LOG_FATAL);
    // The motor is left alone: a Kinect whose motor another program has still streams.
    freenect_select_subdevices(context, FREENECT_DEVICE_CAMERA);
    if (freenect_num_devices(context) <= static_cast<int>(options.device)) {
        return refuse("no Kinect is plugged in; 'stillmesh cameras' says more.");
    }
    if (freenect_open_device(context, &device, static_cast<int>(options.device)) != 0) {
        device = nullptr;
        return refuse("the Kinect cannot be opened; 'stillmesh cameras' says why.");
    }
    return start_streams(device);
}

bool FreenectCamera::Session::start_streams(freenect_device* device) {
    freenect_frame_mode colour_mode{};
    for (int i = 0; i < freenect_get_video_mode_count() && colour_mode.is_valid == 0; ++i) {
        const freenect_frame_mode mode = freenect_get_video_mode(i);
        if (mode.resolution == FREENECT_RESOLUTION_MEDIUM && mode.video_format == FREENECT_VIDEO_RGB)
            colour_mode = mode;
    }
    freenect_frame_mode depth_mode{};
    for (int i = 0; i < freenect_get_depth_mode_count(); ++i) {
        const freenect_frame_mode mode = freenect_get_depth_mode(i);
        if (mode.resolution != FREENECT_RESOLUTION_MEDIUM) continue;
        const bool is_better = mode.depth_format == FREENECT_DEPTH_REGISTERED ||
                               (mode.depth_format == FREENECT_DEPTH_11BIT && depth_mode.is_valid == 0);
        if (is_better) depth_mode = mode;
    }
    is_registered = depth_mode.is_valid != 0 && depth_mode.depth_format == FREENECT_DEPTH_REGISTERED;
    if (colour_mode.is_valid == 0 || depth_mode.is_valid == 0 || colour_mode.bytes != static_cast<int>(kPixels * 3) ||
        depth_mode.bytes != static_cast<int>(kPixels * 2)) {
        return refuse("the Kinect has no mode of 640x480 with colour and depth.");
    }
    freenect_set_user(device, this);
    freenect_set_video_callback(device, &on_colour);
    freenect_set_depth_callback(device, &on_depth);
    colour_writing = Taken<std::uint8_t>::take(colour_buffers);
    depth_writing = Taken<std::uint16_t>::take(depth_buffers);
    const bool is_started = freenect_set_video_mode(device, colour_mode) == 0 &&
                            freenect_set_depth_mode(device, depth_mode) == 0 &&
                            freenect_set_video_buffer(device, colour_writing.pixels()) == 0 &&
                            freenect_set_depth_buffer(device, depth_writing.pixels()) == 0 &&
                            freenect_start_depth(device) == 0 && freenect_start_video(device) == 0;
    return is_started || refuse("the Kinect does not start its streams; 'stillmesh cameras --reset' may help.");
}

void FreenectCamera::Session::read(freenect_context* context) {
    for (;;) {
        timeval wait{0, 50'000};
        const int code = freenect_process_events_timeout(context, &wait);
        bool is_silent = false;
        {
            const std::lock_guard lock(mutex);
            counts.reader_cpu_ns = live::clock_ns(CLOCK_THREAD_CPUTIME_ID);
            if (is_closing) return;
            is_silent = monotonic_ns() - last_image_ns > std::int64_t{options.gone_ms} * 1'000'000;
        }
        // After it was unplugged, libfreenect only falls silent.
        const bool is_unplugged = is_silent && freenect_num_devices(context) <= static_cast<int>(options.device);
        if (code >= 0 && !is_unplugged) continue;
        const std::lock_guard lock(mutex);
        gone_why = is_unplugged ? "unplugged" : "libfreenect has given it up";
        return;
    }
}

void FreenectCamera::Session::serve() noexcept {
    if (options.thread_begins) options.thread_begins();
    freenect_context* context = nullptr;
    freenect_device* device = nullptr;
    const bool is_begun = freenect_init(&context, nullptr) >= 0;
    const bool is_streaming = is_begun ? start(context, device) : refuse("libfreenect finds no USB.");
    {
        const std::lock_guard lock(mutex);
        is_opened = is_streaming;
        is_closed = !is_streaming;
        last_image_ns = monotonic_ns();
        begin(kPeriod_us, last_image_ns);
        changed.notify_all();
    }
    if (is_streaming) read(context);
    changed.notify_all();  // it may be gone
    if (device != nullptr) {
        static_cast<void>(freenect_stop_video(device));
        static_cast<void>(freenect_stop_depth(device));
        static_cast<void>(freenect_close_device(device));
    }
    if (is_begun) static_cast<void>(freenect_shutdown(context));
    const std::lock_guard lock(mutex);
    is_closed = true;
    changed.notify_all();
}

FreenectCamera::FreenectCamera(FreenectOptions options) : options_(std::move(options)) {}

FreenectCamera::~FreenectCamera() {
    close();
}

Status FreenectCamera::refuse(Status status, std::string why) {
    message_ = std::move(why);
    return status;
}

Status FreenectCamera::open() noexcept {
    close();
    try {
        if (const Status status = load_calibration(options_.calibration, info_, message_); status != Status::kOk) {
            return status == Status::kUnavailable ? Status::kInvalid : status;
        }
        CameraModel& model = info_.model;
        if (model.width == 0 && model.height == 0) model.width = kWidth, model.height = kHeight;
        if (model.width != kWidth || model.height != kHeight) {
            return refuse(Status::kInvalid,
                          options_.calibration + ": is of another image size than the Kinect's 640x480.");
        }
        info_.depth_units_per_m = 1000;
        info_.frames_per_s = 30;
        session_ = std::make_shared<Session>(options_);
        std::thread([session = session_] { session->serve(); }).detach();
        const bool is_answered = session_->answers_within(options_.open_max_ms);
        if (is_answered && session_->is_opened) {
            if (!session_->is_registered && registration_ == nullptr) {
                CameraModel depth = model;
                depth.fx = depth.fy = options_.depth_fx;
                depth.cx = (kWidth - 1) / 2.0;
                depth.cy = (kHeight - 1) / 2.0;
                registration_ =
                    std::make_unique<DepthRegistration>(depth, model, options_.baseline_m, info_.depth_units_per_m);
                for (std::uint32_t raw = 0; raw < kRawValues; ++raw) {
                    millimetres_of_raw_.push_back(kinect_millimetres(static_cast<std::uint16_t>(raw)));
                }
                millimetres_.resize(kPixels);
                registered_.resize(kPixels);
            }
            return refuse(Status::kOk, "");
        }
        const std::string why =
            is_answered ? session_->message : "the Kinect does not answer; unplug it and plug it in again.";
        session_.reset();
        return refuse(Status::kUnavailable, why);
    } catch (const std::exception& error) {
        session_.reset();
        message_ = "the Kinect cannot be opened: no memory or no thread.";
        return Status::kUnavailable;
    }
}

Status FreenectCamera::poll(Frame& frame) noexcept {
    if (session_ == nullptr) return Status::kUnavailable;
    const live::CpuMeter meter(before_.poll_cpu_ns);
    Session& session = *session_;
    if (const Status status = session.take(message_); status != Status::kOk) return status;
    const Session::Pair& given = *session.given;  // nobody else's until the next poll
    const std::uint16_t* depth = given.depth.depth.pixels();
    if (!session.is_registered) {
        for (std::size_t i = 0; i < kPixels; ++i) millimetres_[i] = millimetres_of_raw_[depth[i] % kRawValues];
        registration_->reproject({millimetres_.data(), kWidth, kHeight, kWidth}, registered_.data());
        depth = registered_.data();
    }
    session.time_of_day.begin(given.colour_us, given.taken_ns);
    due_ns_ = given.taken_ns;
    frame.time_ns = session.time_of_day.unix_ns(given.colour_us);
    frame.depth_time_ns = session.time_of_day.unix_ns(given.depth_us);
    frame.format = PixelFormat::kRgb8;
    frame.colour = {given.colour.colour.pixels(), kWidth, kHeight, std::size_t{3} * kWidth};
    frame.depth = {depth, kWidth, kHeight, kWidth};
    frame.depth_units_per_m = info_.depth_units_per_m;
    return Status::kOk;
}

Status FreenectCamera::wait(std::uint32_t timeout_ms) noexcept {
    return session_ != nullptr ? session_->wait(timeout_ms) : Status::kUnavailable;
}

void FreenectCamera::close() noexcept {
    if (session_ == nullptr) return;
    // Whoever does not come back keeps the session for itself.
    static_cast<void>(session_->closes_within(options_.open_max_ms));
    before_ = counts();
    session_.reset();
}

std::int64_t FreenectCamera::next_due_ns() noexcept {
    return session_ != nullptr ? session_->next_due_ns(monotonic_ns()) : monotonic_ns() + period_ns();
}

std::string FreenectCamera::silence() const {
    if (session_ == nullptr) return {};
    const std::lock_guard lock(session_->mutex);
    return session_->silent_stream();
}

std::string FreenectCamera::device() const {
    return std::string("Kinect, 640x480@30, depth registered ") +
           (is_registered_by_driver() ? "by libfreenect" : "here");
}

LiveCounts FreenectCamera::counts() const noexcept {
    LiveCounts sum = before_;
    if (session_ != nullptr) sum.add(session_->counted());
    return sum;
}

bool FreenectCamera::is_registered_by_driver() const noexcept {
    return session_ != nullptr && session_->is_registered;
}

}  // namespace stillmesh
