#include "hal/openni2/openni2_camera.hpp"

#include <OpenNI.h>
#include <time.h>

#include <algorithm>
#include <array>
#include <cerrno>
#include <chrono>
#include <cmath>
#include <condition_variable>
#include <cstdio>
#include <cstring>
#include <filesystem>
#include <mutex>
#include <optional>
#include <string_view>
#include <thread>
#include <utility>

#include "hal/calibration/calibration.hpp"
#include "hal/live/depth_registration.hpp"
#include "hal/live/device_clock.hpp"
#include "hal/openni2/openni2_runtime.hpp"

namespace stillmesh {
namespace {

using openni::VideoFrameRef;
using openni2::DeviceWatch;
using openni2::Runtime;

constexpr double kFocalDefault = 525.0 / 640.0;  // of the width: what the PrimeSense kind has
// A file that gives nothing for so long has ended, whatever it promised.
constexpr int kFileSilence_ms = 3000;
constexpr int kLiveSilence_ms = 20;  // how long closing waits for the reader
// A recording to which nothing is added for so long is written.
constexpr int kSettled_ms = 200;
constexpr int kPairWait_ms = 1000;
// The player of files waits with its next image after so long; from being opened on, also on a busy machine.
constexpr int kPlayerRests_ms = 50;
constexpr int kPlayerBegins_ms = 300;
constexpr std::uint32_t kEndMax_ms = 1500;  // for OpenNI2 to end
constexpr int kSettleLook_ms = 20;
constexpr std::int64_t kRecent_ns = 500'000'000;  // what explains a silence has happened within it
constexpr int kSettleMax_ms = 3000;
// Images/s that pairing believes in: half a period is at most 33 ms, at least 8.
constexpr int kPairingRateMin = 15;
constexpr int kPairingRateMax = 60;
constexpr std::uint32_t kFileImagesMax = 1000;  // without a pair: the two streams do not belong together

[[nodiscard]] std::int64_t clock_ns(clockid_t clock) noexcept {
    timespec now{};
    static_cast<void>(::clock_gettime(clock, &now));
    return std::int64_t{now.tv_sec} * 1'000'000'000 + now.tv_nsec;
}

// Processor time of this thread between construction and destruction, added to a sum.
class CpuMeter {
public:
    explicit CpuMeter(std::int64_t& sum_ns) noexcept : sum_ns_(sum_ns), begin_ns_(clock_ns(CLOCK_THREAD_CPUTIME_ID)) {}
    ~CpuMeter() { sum_ns_ += clock_ns(CLOCK_THREAD_CPUTIME_ID) - begin_ns_; }
    CpuMeter(const CpuMeter&) = delete;
    CpuMeter& operator=(const CpuMeter&) = delete;

private:
    std::int64_t& sum_ns_;
    std::int64_t begin_ns_;
};

// What is added to the monotonic clock to get the time of day: once per process, so that no time jumps.
[[nodiscard]] std::int64_t unix_minus_monotonic_ns() noexcept {
    static const std::int64_t offset_ns = clock_ns(CLOCK_REALTIME) - clock_ns(CLOCK_MONOTONIC);
    return offset_ns;
}

// A recording, by its name or because there is such a file.
[[nodiscard]] bool names_file(const std::string& device) {
    constexpr std::string_view kEnding = ".oni";
    std::error_code error;
    return (device.size() > kEnding.size() &&
            std::equal(kEnding.begin(), kEnding.end(), device.end() - static_cast<std::ptrdiff_t>(kEnding.size()),
                       [](char a, char b) { return a == b || (b >= 'A' && b <= 'Z' && a == b + ('a' - 'A')); })) ||
           std::filesystem::is_regular_file(device, error);
}

// Why a file is none that OpenNI2 could play; empty: it may.
[[nodiscard]] std::string why_no_recording(const std::string& name) {
    errno = 0;
    std::FILE* const file = std::fopen(name.c_str(), "rb");
    char magic[4] = {};
    const bool is_long_enough = file != nullptr && std::fread(magic, 1, sizeof(magic), file) == sizeof(magic);
    const int error = errno;
    if (file != nullptr) static_cast<void>(std::fclose(file));
    if (error == ENOENT) return "there is no such file.";
    if (error != 0) return std::string("cannot be read: ") + std::strerror(error) + ".";
    if (!is_long_enough) return "is empty.";
    return std::memcmp(magic, "NI10", sizeof(magic)) == 0 ? std::string()
                                                          : "is no .oni recording (it does not begin with NI10).";
}

[[nodiscard]] std::string extended_error() {
    std::string text = openni::OpenNI::getExtendedError();
    while (!text.empty() && (text.back() == '\n' || text.back() == ' ' || text.back() == '\t')) text.pop_back();
    for (char& c : text) {
        if (c == '\n' || c == '\t') c = ' ';
    }
    text.erase(0, text.find_first_not_of(' '));
    return text.empty() ? "OpenNI2 does not say why" : text;
}

// Which of two colour formats is nearer to what the engine takes; -1: none of its.
[[nodiscard]] int colour_rank(openni::PixelFormat format) {
    switch (format) {
        case openni::PIXEL_FORMAT_RGB888: return 4;
        case openni::PIXEL_FORMAT_GRAY8: return 3;
        case openni::PIXEL_FORMAT_YUYV: return 2;
        case openni::PIXEL_FORMAT_YUV422: return 1;
        default: return -1;
    }
}
[[nodiscard]] int depth_rank(openni::PixelFormat format) {
    return format == openni::PIXEL_FORMAT_DEPTH_1_MM ? 2 : (format == openni::PIXEL_FORMAT_DEPTH_100_UM ? 1 : -1);
}
[[nodiscard]] std::uint32_t bytes_per_pixel(openni::PixelFormat format) {
    switch (format) {
        case openni::PIXEL_FORMAT_RGB888: return 3;
        case openni::PIXEL_FORMAT_GRAY8: return 1;
        default: return 2;
    }
}

[[nodiscard]] std::string mode_text(const openni::VideoMode& mode) {
    return std::to_string(mode.getResolutionX()) + "x" + std::to_string(mode.getResolutionY()) + "@" +
           std::to_string(mode.getFps());
}

// The mode of this size that suits best: 30 frames/s, else the nearest to it, then the format; none: nullopt.
template <typename Rank>
[[nodiscard]] std::optional<openni::VideoMode> best_mode(const openni::SensorInfo& sensor, int width, int height,
                                                         Rank rank) {
    std::optional<openni::VideoMode> best;
    const openni::Array<openni::VideoMode>& modes = sensor.getSupportedVideoModes();
    const auto cost = [&rank](const openni::VideoMode& mode) {
        return 10 * std::abs(mode.getFps() - 30) - rank(mode.getPixelFormat());
    };
    for (int i = 0; i < modes.getSize(); ++i) {
        const openni::VideoMode& mode = modes[i];
        if (mode.getResolutionX() != width || mode.getResolutionY() != height || rank(mode.getPixelFormat()) < 0 ||
            mode.getFps() < 5) {
            continue;
        }
        if (!best || cost(mode) < cost(*best)) best = mode;
    }
    return best;
}

[[nodiscard]] std::string modes_of(const openni::SensorInfo& sensor) {
    std::string text;
    const openni::Array<openni::VideoMode>& modes = sensor.getSupportedVideoModes();
    for (int i = 0; i < modes.getSize() && text.size() < 300; ++i) {
        const std::string mode = mode_text(modes[i]);
        if (text.find(mode) == std::string::npos) text += (text.empty() ? "" : " ") + mode;
    }
    return text.empty() ? "none" : text;
}

}  // namespace

// One opening of a device or file, on whatever threads. Nothing in it refers to the camera: if closing hangs, it is
// left behind with the thread that hangs.
struct OpenNi2Camera::Session {
    using Pairer = FramePairer<VideoFrameRef>;
    struct Slot {
        VideoFrameRef colour, depth;
        std::int64_t colour_us = 0, depth_us = 0;
        std::int64_t taken_ns = 0;     // the colour image, on the host's clock
        std::int64_t complete_ns = 0;  // the pair was there
        bool is_full = false;

        void clear() {
            colour.release();
            depth.release();
            is_full = false;
        }
    };

    // Of the thread that serves; the camera reads it once it is opened or closed.
    std::shared_ptr<Runtime> runtime;
    openni::Device device;
    openni::VideoStream colour, depth;
    openni::Recorder recorder;
    openni::VideoMode colour_mode, depth_mode;
    std::shared_ptr<DeviceWatch> watch = std::make_shared<DeviceWatch>();
    Status status = Status::kUnavailable;
    std::string message, description, record_file;
    std::vector<std::string> notes;
    bool is_file = false;
    bool is_registered = false;
    bool is_colour_mirrored = false, is_depth_mirrored = false;
    double fov_x = 0, depth_fov_x = 0;
    int colour_images = 0, depth_images = 0;  // of a file

    std::mutex mutex;  // of all below
    std::condition_variable changed;
    bool is_opened = false, is_closing = false, is_closed = false;
    bool has_ended = false;  // the file
    Pairer pairer{33'333};
    Slot slot, given;
    DeviceClock clock;
    ArrivalForecast forecast;
    std::int64_t time_shift_ns = 0;  // of live stamps to the time of day
    bool has_time_shift = false;
    int colour_index = -1, depth_index = -1;
    std::int64_t last_colour_us = 0, last_depth_us = 0;
    std::int64_t colour_arrival_ns = 0, depth_arrival_ns = 0;  // of the last image of either
    std::int64_t wrong_form_ns = -kRecent_ns;                  // when a pair of another form came last
    OpenNi2Counts counts;

    ~Session() = default;

    // Opens, reads until it is told to close, closes: all on one thread, the only one that calls OpenNI2.
    void serve(const OpenNi2Options& options);

private:
    void open(const OpenNi2Options& options);
    void close();
    // One image of either stream; true: it made a pair, which is in the slot, or it is a file's first image again.
    bool take(openni::VideoStream& stream, std::int64_t arrival_ns);
    void read_live();
    void read_file();
    [[nodiscard]] bool refuse(Status why, std::string text) {
        status = why;
        message = std::move(text);
        return false;
    }
    [[nodiscard]] bool open_device(const OpenNi2Options& options);
    [[nodiscard]] bool start(const OpenNi2Options& options);
    [[nodiscard]] bool start_modes(const OpenNi2Options& options, const openni::VideoMode& colour_wanted,
                                   const openni::VideoMode& depth_wanted);
    [[nodiscard]] bool record(const OpenNi2Options& options);
    void rest_player();
    static void settle(const std::string& file);
};

bool OpenNi2Camera::Session::open_device(const OpenNi2Options& options) {
    if (is_file) {
        if (const std::string why = why_no_recording(options.device); !why.empty()) {
            return refuse(Status::kInvalid, options.device + ": " + why);
        }
        if (device.open(options.device.c_str()) != openni::STATUS_OK || !device.isFile()) {
            return refuse(Status::kInvalid, options.device + ": OpenNI2 cannot play it (" + extended_error() +
                                                "); was its recording cut off?");
        }
        description = options.device;
        return true;
    }
    const std::vector<openni2::DeviceName> devices = runtime->devices();
    std::string seen;
    std::string failure;
    const bool is_uri = std::any_of(devices.begin(), devices.end(),
                                    [&options](const openni2::DeviceName& name) { return name.uri == options.device; });
    for (const openni2::DeviceName& name : devices) {
        if (is_uri && name.uri != options.device) continue;  // to open another one for its serial number may disturb it
        seen += (seen.empty() ? " " : ", ") + name.uri;
        const bool is_any = options.device.empty() || options.device == "auto";
        if (device.open(name.uri.c_str()) != openni::STATUS_OK) {
            if (is_any || options.device == name.uri) failure = name.uri + " cannot be opened: " + extended_error();
            continue;
        }
        char serial[128] = {};
        int size = sizeof(serial) - 1;
        if (device.getProperty(openni::DEVICE_PROPERTY_SERIAL_NUMBER, serial, &size) != openni::STATUS_OK)
            serial[0] = 0;
        if (is_any || options.device == name.uri || (serial[0] != 0 && options.device == serial)) {
            watch->uri = name.uri;
            description = name.vendor + " " + name.name + ", " + name.uri;
            if (serial[0] != 0) description += std::string(", serial ") + serial;
            return true;
        }
        if (serial[0] != 0) seen += std::string(" (serial ") + serial + ")";
        device.close();
    }
    if (!failure.empty()) {
        return refuse(Status::kUnavailable, failure + "; 'stillmesh cameras' says what keeps it from working.");
    }
    if (devices.empty())
        return refuse(Status::kUnavailable,
                      "no camera is plugged in that OpenNI2 knows; 'stillmesh cameras' says what is, and what to do.");
    return refuse(Status::kUnavailable,
                  "no camera has the URI or serial number '" + options.device + "'; there are:" + seen + ".");
}

bool OpenNi2Camera::Session::start_modes(const OpenNi2Options& options, const openni::VideoMode& colour_wanted,
                                         const openni::VideoMode& depth_wanted) {
    if (!is_file && (colour.setVideoMode(colour_wanted) != openni::STATUS_OK ||
                     depth.setVideoMode(depth_wanted) != openni::STATUS_OK)) {
        return refuse(Status::kInvalid,
                      "the mode " + mode_text(colour_wanted) + " is refused: " + extended_error() + ".");
    }
    colour_mode = colour.getVideoMode();
    depth_mode = depth.getVideoMode();
    if (colour_rank(colour_mode.getPixelFormat()) < 0 || depth_rank(depth_mode.getPixelFormat()) < 0) {
        return refuse(Status::kInvalid, "its pixel formats (colour " + std::to_string(colour_mode.getPixelFormat()) +
                                            ", depth " + std::to_string(depth_mode.getPixelFormat()) +
                                            " in OpenNI2's numbers) are not RGB or grey and depth in mm.");
    }
    const auto is_within = [](const openni::VideoMode& mode, int width_max, int height_max) {
        return mode.getResolutionX() >= 33 && mode.getResolutionY() >= 33 && mode.getResolutionX() <= width_max &&
               mode.getResolutionY() <= height_max;
    };
    if (!is_within(colour_mode, static_cast<int>(options.width_max), static_cast<int>(options.height_max)) ||
        !is_within(depth_mode, 2047, 2047)) {
        return refuse(Status::kInvalid, "its mode " + mode_text(colour_mode) + " is larger than the limits (" +
                                            std::to_string(options.width_max) + "x" +
                                            std::to_string(options.height_max) + ").");
    }

    if (!is_file) {
        static_cast<void>(colour.setMirroringEnabled(false));
        static_cast<void>(depth.setMirroringEnabled(false));
    }
    is_colour_mirrored = colour.getMirroringEnabled();
    is_depth_mirrored = depth.getMirroringEnabled();

    is_registered =
        options.registration == Registration::kNone || (is_file && options.registration == Registration::kAuto);
    if (is_file && options.registration == Registration::kAuto) {
        notes.emplace_back(
            "an .oni file does not say whether depth is registered to colour: taken as registered; if people have two "
            "outlines, use --registration here.");
    }
    if (!is_file && options.registration == Registration::kAuto &&
        device.isImageRegistrationModeSupported(openni::IMAGE_REGISTRATION_DEPTH_TO_COLOR)) {
        is_registered =
            device.setImageRegistrationMode(openni::IMAGE_REGISTRATION_DEPTH_TO_COLOR) == openni::STATUS_OK &&
            device.getImageRegistrationMode() == openni::IMAGE_REGISTRATION_DEPTH_TO_COLOR;
    } else if (!is_file && options.registration == Registration::kHere) {
        static_cast<void>(device.setImageRegistrationMode(openni::IMAGE_REGISTRATION_OFF));
    }
    fov_x = static_cast<double>(colour.getHorizontalFieldOfView());
    depth_fov_x = static_cast<double>(depth.getHorizontalFieldOfView());

    if (openni::CameraSettings* const settings = is_file ? nullptr : colour.getCameraSettings()) {
        const bool is_auto = options.exposure == Exposure::kAuto;
        const bool is_set = settings->setAutoExposureEnabled(is_auto) == openni::STATUS_OK;
        static_cast<void>(settings->setAutoWhiteBalanceEnabled(is_auto));
        if (!is_set && !is_auto) notes.emplace_back("this camera's exposure cannot be fixed.");
    }
    const int fps = std::max(colour_mode.getFps(), 1);
    if (fps != depth_mode.getFps()) {
        notes.push_back("colour comes at " + std::to_string(fps) + " and depth at " +
                        std::to_string(depth_mode.getFps()) + " images/s: what finds no partner is dropped.");
    }
    // Whatever a file says: its images are no further apart than these rates'.
    pairer = Pairer(1'000'000 / std::clamp(std::max(fps, depth_mode.getFps()), kPairingRateMin, kPairingRateMax));
    if (depth.start() == openni::STATUS_OK && colour.start() == openni::STATUS_OK) return true;
    const std::string why = extended_error();
    depth.stop();
    colour.stop();
    return refuse(Status::kUnavailable, "its streams do not start: " + why + ".");
}

bool OpenNi2Camera::Session::start(const OpenNi2Options& options) {
    if (!device.hasSensor(openni::SENSOR_DEPTH) || !device.hasSensor(openni::SENSOR_COLOR)) {
        return refuse(Status::kInvalid, description + ": has no " +
                                            (device.hasSensor(openni::SENSOR_DEPTH) ? "colour" : "depth") +
                                            " images; both are needed.");
    }
    if (depth.create(device, openni::SENSOR_DEPTH) != openni::STATUS_OK ||
        colour.create(device, openni::SENSOR_COLOR) != openni::STATUS_OK) {
        return refuse(Status::kUnavailable, description + ": its streams cannot be made: " + extended_error() + ".");
    }
    if (is_file) {
        openni::PlaybackControl* const playback = device.getPlaybackControl();
        // Repeated, though nobody wants it twice: at its end the player's thread would look through the list of
        // streams, without a lock, again and again, also while they are destroyed. So it waits with the first image.
        if (playback == nullptr || playback->setRepeatEnabled(true) != openni::STATUS_OK ||
            playback->setSpeed(-1.0F) != openni::STATUS_OK) {
            return refuse(Status::kInvalid,
                          description + ": cannot be played frame by frame: " + extended_error() + ".");
        }
        colour_images = playback->getNumberOfFrames(colour);
        depth_images = playback->getNumberOfFrames(depth);
        if (colour_images <= 0 || depth_images <= 0) {
            return refuse(Status::kInvalid, description +
                                                ": holds no images of colour or of depth; was its recording "
                                                "cut off?");
        }
        if (start_modes(options, colour.getVideoMode(), depth.getVideoMode())) return true;
        message = description + ": " + message;
        return false;
    }
    std::string last = description +
                       ": offers no mode of 640x480 or 320x240 within the limits for colour and depth (colour " +
                       modes_of(colour.getSensorInfo()) + "; depth " + modes_of(depth.getSensorInfo()) + ").";
    struct Size {
        int width, height;
    };
    constexpr std::array<Size, 2> kSizes = {Size{640, 480}, Size{320, 240}};
    Status last_status = Status::kInvalid;
    // The same size for both; then, where there is none, whatever goes together.
    for (const bool is_mixed : {false, true}) {
        for (const Size& size : kSizes) {
            if (size.width > static_cast<int>(options.width_max) ||
                size.height > static_cast<int>(options.height_max)) {
                continue;
            }
            const auto colour_best = best_mode(colour.getSensorInfo(), size.width, size.height, colour_rank);
            for (const Size& depth_size : kSizes) {
                if ((depth_size.width == size.width) == is_mixed) continue;
                const auto depth_best =
                    best_mode(depth.getSensorInfo(), depth_size.width, depth_size.height, depth_rank);
                if (!colour_best || !depth_best) continue;
                if (start_modes(options, *colour_best, *depth_best)) return true;
                last = description + ": " + message;
                last_status = status;
            }
        }
    }
    return refuse(last_status, last);
}

// Returns when nothing has been written into a file for a while.
void OpenNi2Camera::Session::settle(const std::string& file) {
    std::uintmax_t size = 0;
    int quiet_ms = 0;
    for (int waited_ms = 0; quiet_ms < kSettled_ms && waited_ms < kSettleMax_ms; waited_ms += kSettleLook_ms) {
        std::this_thread::sleep_for(std::chrono::milliseconds(kSettleLook_ms));
        std::error_code error;
        const std::uintmax_t now = std::filesystem::file_size(file, error);
        quiet_ms = now == size ? quiet_ms + kSettleLook_ms : 0;
        size = now;
    }
}

bool OpenNi2Camera::Session::record(const OpenNi2Options& options) {
    if (options.record.empty()) return true;
    record_file = options.record;
    if (std::FILE* const file = std::fopen(record_file.c_str(), "wb"); file != nullptr) {
        static_cast<void>(std::fclose(file));
    } else {  // OpenNI2 would not say why
        return refuse(Status::kInvalid, record_file + ": cannot be written: " + std::strerror(errno) + ".");
    }
    if (recorder.create(options.record.c_str()) == openni::STATUS_OK && recorder.attach(depth) == openni::STATUS_OK &&
        recorder.attach(colour) == openni::STATUS_OK) {
        // The recorder gives the first image of each stream the time 0. Begun between colour and depth of one instant,
        // it would shift them against each other by an image: it begins behind a pair.
        const std::int64_t end_ns = clock_ns(CLOCK_MONOTONIC) + std::int64_t{kPairWait_ms} * 1'000'000;
        openni::VideoStream* streams[2] = {&depth, &colour};
        bool is_pair = false;
        while (!is_pair && clock_ns(CLOCK_MONOTONIC) < end_ns) {
            int ready = -1;
            is_pair = openni::OpenNI::waitForAnyStream(streams, 2, &ready, kLiveSilence_ms) == openni::STATUS_OK &&
                      take(*streams[ready], clock_ns(CLOCK_MONOTONIC));
        }
        if (recorder.start() == openni::STATUS_OK) return true;
    }
    return refuse(Status::kInvalid, options.record + ": cannot be recorded: " + extended_error() + ".");
}

void OpenNi2Camera::Session::open(const OpenNi2Options& options) {
    runtime = Runtime::get(message);
    if (runtime == nullptr) return;
    if (!open_device(options)) return;
    watch->changed = [this] {
        const std::lock_guard lock(mutex);
        changed.notify_all();
    };
    if (!is_file) runtime->watch(watch);
    if (start(options) && record(options)) status = Status::kOk;
}

// OpenNI2's player must be at rest before anything of it is taken away: its thread looks through the streams without a
// lock unless it waits to give out an image, and one that has not even begun is never told to end.
void OpenNi2Camera::Session::rest_player() {
    const bool has_begun = counts.images_colour + counts.images_depth > 0;
    if (!has_begun && depth.isValid()) static_cast<void>(depth.start());
    if (!has_begun && colour.isValid()) static_cast<void>(colour.start());
    std::this_thread::sleep_for(std::chrono::milliseconds(has_begun ? kPlayerRests_ms : kPlayerBegins_ms));
}

void OpenNi2Camera::Session::close() {
    {
        const std::lock_guard lock(mutex);
        is_closing = true;
        changed.notify_all();
    }
    if (is_file && device.isValid()) rest_player();
    if (colour.isValid()) colour.stop();
    if (depth.isValid()) depth.stop();
    if (recorder.isValid()) {
        // A driver's thread that brings an image holds the stream's lock and waits for the recorder's; who destroys the
        // recorder meanwhile takes them the other way round, and both hang for ever. So first all is to be written.
        recorder.stop();
        settle(record_file);
        recorder.destroy();
    }
    {
        // Before the streams they came from are gone.
        const std::lock_guard lock(mutex);
        slot.clear();
        given.clear();
        pairer = Pairer(33'333);
    }
    colour.destroy();
    depth.destroy();
    if (device.isValid()) device.close();
    if (runtime != nullptr) runtime->forget(watch);
    if (is_opened) runtime.reset();  // else the camera takes it
}

bool OpenNi2Camera::Session::take(openni::VideoStream& stream, std::int64_t arrival_ns) {
    VideoFrameRef image;
    if (stream.readFrame(&image) != openni::STATUS_OK || !image.isValid()) return false;
    const bool is_colour = image.getSensorType() == openni::SENSOR_COLOR;
    const auto time_us = static_cast<std::int64_t>(std::min<std::uint64_t>(image.getTimestamp(), 1ULL << 52U));
    Slot old;  // released without the lock
    const std::lock_guard lock(mutex);
    if (is_closing) return false;
    int& index = is_colour ? colour_index : depth_index;
    std::int64_t& last_us = is_colour ? last_colour_us : last_depth_us;
    if (is_file && image.getFrameIndex() <= index && time_us <= last_us) {  // it begins again
        has_ended = true;
        changed.notify_all();
        return true;
    }
    last_us = time_us;
    (is_colour ? colour_arrival_ns : depth_arrival_ns) = arrival_ns;
    const int missing = image.getFrameIndex() - index - 1;
    if (index >= 0 && missing > 0 && missing < 1000) counts.images_missing += static_cast<std::uint64_t>(missing);
    index = image.getFrameIndex();
    ++(is_colour ? counts.images_colour : counts.images_depth);
    // Both streams have one clock: each image tells something about it.
    if (!is_file) static_cast<void>(clock.host_ns(time_us, arrival_ns));
    std::optional<Pairer::Pair> pair =
        is_colour ? pairer.add_colour(std::move(image), time_us) : pairer.add_depth(std::move(image), time_us);
    if (!pair) return false;
    if (slot.is_full) ++counts.dropped;
    old = std::move(slot);
    slot.colour = std::move(pair->colour);
    slot.depth = std::move(pair->depth);
    slot.colour_us = pair->colour_us;
    slot.depth_us = pair->depth_us;
    slot.taken_ns = is_file ? arrival_ns : clock.host_ns(pair->colour_us, arrival_ns);
    slot.complete_ns = arrival_ns;
    slot.is_full = true;
    forecast.arrived(slot.taken_ns, arrival_ns);
    changed.notify_all();
    return true;
}

void OpenNi2Camera::Session::read_live() {
    std::int64_t cpu_ns = 0;
    bool is_there = false;
    {
        const CpuMeter meter(cpu_ns);
        openni::VideoStream* streams[2] = {&depth, &colour};
        int ready = -1;
        is_there = openni::OpenNI::waitForAnyStream(streams, 2, &ready, kLiveSilence_ms) == openni::STATUS_OK;
        if (is_there) static_cast<void>(take(*streams[ready], clock_ns(CLOCK_MONOTONIC)));
    }
    const std::lock_guard lock(mutex);
    counts.reader_cpu_ns += cpu_ns;
}

void OpenNi2Camera::Session::read_file() {
    {
        std::unique_lock lock(mutex);
        changed.wait(lock, [this] { return is_closing || (!slot.is_full && !has_ended); });
        if (is_closing) return;
    }
    openni::VideoStream* streams[2] = {&depth, &colour};
    for (std::uint32_t i = 0;; ++i) {
        int ready = -1;
        const bool has_all = counts.images_colour >= static_cast<std::uint64_t>(colour_images) &&
                             counts.images_depth >= static_cast<std::uint64_t>(depth_images);
        if (has_all || i > kFileImagesMax ||
            openni::OpenNI::waitForAnyStream(streams, 2, &ready, kFileSilence_ms) != openni::STATUS_OK) {
            break;
        }
        if (take(*streams[ready], clock_ns(CLOCK_MONOTONIC))) return;
    }
    const std::lock_guard lock(mutex);
    has_ended = true;
    changed.notify_all();
}

void OpenNi2Camera::Session::serve(const OpenNi2Options& options) {
    if (options.thread_begins) options.thread_begins();
    open(options);
    {
        const std::lock_guard lock(mutex);
        is_opened = status == Status::kOk;
        changed.notify_all();
    }
    while (is_opened) {
        {
            const std::lock_guard lock(mutex);
            if (is_closing) break;
        }
        if (is_file) {
            read_file();
        } else {
            read_live();
        }
    }
    close();
    const std::lock_guard lock(mutex);
    is_closed = true;
    changed.notify_all();
}

// Images made here, because the device does not give them as they are needed.
struct OpenNi2Camera::Conversion {
    std::optional<DepthRegistration> registration;
    std::vector<std::uint16_t> depth;          // registered or scaled
    std::vector<std::uint16_t> depth_upright;  // not mirrored
    std::vector<std::uint8_t> colour;          // not mirrored, or grey made of YUV
};

OpenNi2Camera::OpenNi2Camera(OpenNi2Options options)
    : options_(std::move(options)), is_file_(names_file(options_.device)) {
    static_cast<void>(unix_minus_monotonic_ns());
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
    if (!openni2::run_parked([session, options = options_] { session->serve(options); })) {
        message_ = "the system has no thread left for the camera.";
        return Status::kUnavailable;
    }
    {
        std::unique_lock lock(session->mutex);
        if (!session->changed.wait_for(lock, std::chrono::milliseconds(options_.open_max_ms),
                                       [&session] { return session->is_opened || session->is_closed; })) {
            session->is_closing = true;  // whenever it comes back
            message_ = "the camera's driver does not answer; unplug the camera and plug it in again.";
            return Status::kUnavailable;
        }
    }
    message_ = session->message;
    if (session->status != Status::kOk) {
        if (session->runtime != nullptr) runtime_ = std::move(session->runtime);
        return session->status;
    }
    runtime_ = session->runtime;
    session_ = session;
    uri_ = session->watch->uri;
    notes_ = session->notes;
    frames_expected_ =
        session->is_file ? static_cast<std::uint64_t>(std::min(session->colour_images, session->depth_images)) : 0;
    info_ = {};
    info_.model.width = static_cast<std::uint32_t>(session->colour_mode.getResolutionX());
    info_.model.height = static_cast<std::uint32_t>(session->colour_mode.getResolutionY());
    info_.frames_per_s = std::max(session->colour_mode.getFps(), 1);
    info_.depth_units_per_m =
        session->depth_mode.getPixelFormat() == openni::PIXEL_FORMAT_DEPTH_100_UM ? 10000.0 : 1000.0;
    if (const Status status = calibrate(session->fov_x); status != Status::kOk) return status;
    prepare_conversion();
    device_ = session->description + ", " + mode_text(session->colour_mode) + ", depth " +
              (session->is_file && options_.registration == Registration::kAuto ? "taken as registered"
               : session->is_registered
                   ? (options_.registration == Registration::kNone ? "taken as registered" : "registered by the camera")
                   : "registered here");
    due_ns_ = clock_ns(CLOCK_MONOTONIC);
    return Status::kOk;
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

void OpenNi2Camera::prepare_conversion() {
    const Session& session = *session_;
    conversion_ = std::make_unique<Conversion>();
    const auto depth_width = static_cast<std::uint32_t>(session.depth_mode.getResolutionX());
    const auto depth_height = static_cast<std::uint32_t>(session.depth_mode.getResolutionY());
    const CameraModel& model = info_.model;
    const std::size_t pixels = std::size_t{model.width} * model.height;
    if (!session.is_registered || depth_width != model.width || depth_height != model.height) {
        CameraModel depth = model;
        const double scale = static_cast<double>(depth_width) / model.width;
        depth.width = depth_width;
        depth.height = depth_height;
        const bool has_fov =
            std::isfinite(session.depth_fov_x) && session.depth_fov_x > 0.3 && session.depth_fov_x < 2.5;
        if (session.is_registered || !has_fov) {
            depth.fx *= scale;
            depth.fy *= scale;
            depth.cx = (depth.cx + 0.5) * scale - 0.5;
            depth.cy = (depth.cy + 0.5) * scale - 0.5;
        } else {
            depth.fx = depth.fy = depth_width / (2.0 * std::tan(0.5 * session.depth_fov_x));
            depth.cx = (depth_width - 1) / 2.0;
            depth.cy = (depth_height - 1) / 2.0;
        }
        conversion_->registration.emplace(depth, model, session.is_registered ? 0.0 : options_.baseline_m,
                                          info_.depth_units_per_m);
        conversion_->depth.resize(pixels);
        if (!session.is_registered) {
            char text[160];
            std::snprintf(text, sizeof(text),
                          "depth is registered to colour here, with a baseline of %.0f mm; a calibrated camera does it "
                          "better.",
                          1e3 * options_.baseline_m);
            notes_.emplace_back(text);
        }
    }
    if (session.is_depth_mirrored) {
        conversion_->depth_upright.resize(std::size_t{depth_width} * depth_height);
    }
    const openni::PixelFormat format = session.colour_mode.getPixelFormat();
    const bool is_yuv = bytes_per_pixel(format) == 2;
    if (session.is_colour_mirrored || is_yuv) {
        conversion_->colour.resize(pixels * (is_yuv ? 1U : bytes_per_pixel(format)));
    }
}

void OpenNi2Camera::convert(Frame& frame) {
    const Session& session = *session_;
    const CameraModel& model = info_.model;
    const openni::PixelFormat format = session.colour_mode.getPixelFormat();
    const std::uint32_t bytes = bytes_per_pixel(format);
    frame.format = format == openni::PIXEL_FORMAT_RGB888 ? PixelFormat::kRgb8 : PixelFormat::kGrey8;
    if (!conversion_->colour.empty()) {
        const std::uint32_t channels = channels_of(frame.format);
        const std::uint32_t offset = format == openni::PIXEL_FORMAT_YUV422 ? 1 : 0;  // u y1 v y2, or y1 u y2 v
        for (std::uint32_t y = 0; y < model.height; ++y) {
            const std::uint8_t* const row = frame.colour.row(y) + offset;
            std::uint8_t* const out = conversion_->colour.data() + std::size_t{y} * model.width * channels;
            for (std::uint32_t x = 0; x < model.width; ++x) {
                const std::uint32_t from = session.is_colour_mirrored ? model.width - 1 - x : x;
                for (std::uint32_t c = 0; c < channels; ++c) out[x * channels + c] = row[from * bytes + c];
            }
        }
        frame.colour = {conversion_->colour.data(), model.width, model.height, std::size_t{model.width} * channels};
    }
    if (!conversion_->depth_upright.empty()) {
        for (std::uint32_t y = 0; y < frame.depth.height; ++y) {
            std::reverse_copy(frame.depth.row(y), frame.depth.row(y) + frame.depth.width,
                              conversion_->depth_upright.data() + std::size_t{y} * frame.depth.width);
        }
        frame.depth = {conversion_->depth_upright.data(), frame.depth.width, frame.depth.height, frame.depth.width};
    }
    if (conversion_->registration) {
        conversion_->registration->reproject(frame.depth, conversion_->depth.data());
        frame.depth = {conversion_->depth.data(), model.width, model.height, model.width};
    }
}

Status OpenNi2Camera::poll(Frame& frame) noexcept {
    if (session_ == nullptr) return Status::kUnavailable;
    const CpuMeter meter(poll_cpu_ns_);
    Session& session = *session_;
    if (session.is_file) {
        std::unique_lock lock(session.mutex);
        static_cast<void>(session.changed.wait_for(lock, std::chrono::milliseconds(options_.open_max_ms),
                                                   [&session] { return session.slot.is_full || session.has_ended; }));
        if (!session.slot.is_full && session.has_ended) {
            message_ = session.description + ": has ended.";
            return Status::kEnd;
        }
    }
    {
        typename Session::Slot old;  // released without the lock
        const std::lock_guard lock(session.mutex);
        if (!session.slot.is_full) {
            if (session.watch->is_gone || session.watch->has_failed) {
                message_ = session.watch->is_gone ? "unplugged" : "its driver reports an error";
                return Status::kUnavailable;
            }
            return Status::kTimedOut;
        }
        old = std::move(session.given);
        session.given = std::move(session.slot);
        session.slot = {};
        if (session.is_file) session.changed.notify_all();  // the next may be read
    }
    const typename Session::Slot& given = session.given;  // of this thread alone until the next poll
    const auto has_form = [](const VideoFrameRef& image, const openni::VideoMode& mode) {
        const auto bytes = static_cast<int>(
            mode.getPixelFormat() == openni::PIXEL_FORMAT_DEPTH_1_MM ? 2 : bytes_per_pixel(mode.getPixelFormat()));
        return image.getWidth() == mode.getResolutionX() && image.getHeight() == mode.getResolutionY() &&
               image.getVideoMode().getPixelFormat() == mode.getPixelFormat() && image.getData() != nullptr &&
               image.getStrideInBytes() >= image.getWidth() * bytes && image.getStrideInBytes() % 2 == 0 &&
               static_cast<std::int64_t>(image.getDataSize()) >=
                   std::int64_t{image.getStrideInBytes()} * (image.getHeight() - 1) + image.getWidth() * bytes;
    };
    if (!has_form(given.colour, session.colour_mode) || !has_form(given.depth, session.depth_mode)) {
        message_ = "an image of another size or format than " + mode_text(session.colour_mode) + ".";
        const std::lock_guard lock(session.mutex);
        ++session.counts.wrong_form;
        session.wrong_form_ns = session.given.complete_ns;
        return Status::kCorrupt;
    }
    frame = {};
    if (!session.has_time_shift) {
        session.has_time_shift = true;
        session.time_shift_ns =
            session.is_file ? 0 : unix_minus_monotonic_ns() + given.taken_ns - given.colour_us * 1000;
    }
    frame.time_ns = given.colour_us * 1000 + session.time_shift_ns;
    frame.depth_time_ns = given.depth_us * 1000 + session.time_shift_ns;
    frame.depth_units_per_m = info_.depth_units_per_m;
    frame.colour = {static_cast<const std::uint8_t*>(given.colour.getData()), info_.model.width, info_.model.height,
                    static_cast<std::size_t>(given.colour.getStrideInBytes())};
    frame.depth = {static_cast<const std::uint16_t*>(given.depth.getData()),
                   static_cast<std::uint32_t>(given.depth.getWidth()),
                   static_cast<std::uint32_t>(given.depth.getHeight()),
                   static_cast<std::size_t>(given.depth.getStrideInBytes()) / 2};
    due_ns_ = given.taken_ns;
    convert(frame);
    return Status::kOk;
}

Status OpenNi2Camera::wait(std::uint32_t timeout_ms) noexcept {
    if (session_ == nullptr) return Status::kUnavailable;
    Session& session = *session_;
    if (session.is_file) return Status::kOk;
    std::unique_lock lock(session.mutex);
    const bool is_ready = session.changed.wait_for(lock, std::chrono::milliseconds(timeout_ms), [&session] {
        return session.slot.is_full || session.watch->is_gone || session.watch->has_failed;
    });
    return is_ready ? Status::kOk : Status::kTimedOut;
}

std::int64_t OpenNi2Camera::next_due_ns() noexcept {
    const auto period_ns = static_cast<std::int64_t>(1e9 / std::max(info_.frames_per_s, 1.0));
    if (session_ == nullptr) return clock_ns(CLOCK_MONOTONIC) + period_ns;
    const std::lock_guard lock(session_->mutex);
    if (session_->slot.is_full) return session_->slot.complete_ns;  // it waits already
    const std::int64_t next_ns = session_->forecast.next_ns(period_ns);
    return next_ns != 0 ? next_ns : clock_ns(CLOCK_MONOTONIC) + period_ns;
}

std::string OpenNi2Camera::silence() const {
    if (session_ == nullptr) return {};
    const std::lock_guard lock(session_->mutex);
    if (clock_ns(CLOCK_MONOTONIC) - session_->wrong_form_ns < kRecent_ns) {
        return "images come, but of another size or format than " + mode_text(session_->colour_mode);
    }
    const std::int64_t apart_ns = session_->colour_arrival_ns - session_->depth_arrival_ns;
    if (apart_ns > kRecent_ns) return "colour images come, depth images do not";
    if (apart_ns < -kRecent_ns) return "depth images come, colour images do not";
    return {};
}

OpenNi2Counts OpenNi2Camera::counts() const noexcept {
    OpenNi2Counts sum = before_;
    sum.poll_cpu_ns = poll_cpu_ns_;
    if (session_ == nullptr) return sum;
    const std::lock_guard lock(session_->mutex);
    const OpenNi2Counts& now = session_->counts;
    sum.pairing.add(session_->pairer.counts());
    sum.images_colour += now.images_colour;
    sum.images_depth += now.images_depth;
    sum.images_missing += now.images_missing;
    sum.dropped += now.dropped;
    sum.wrong_form += now.wrong_form;
    sum.reader_cpu_ns += now.reader_cpu_ns;
    return sum;
}

void OpenNi2Camera::close() noexcept {
    if (session_ == nullptr) return;
    before_ = counts();
    conversion_.reset();
    const std::shared_ptr<Session> session = std::move(session_);
    session_ = nullptr;
    std::unique_lock lock(session->mutex);
    session->is_closing = true;
    session->changed.notify_all();
    if (!session->changed.wait_for(lock, std::chrono::milliseconds(options_.open_max_ms),
                                   [&session] { return session->is_closed; })) {
        message_ = "the camera's driver does not answer; what it holds is left behind.";
    }
}

}  // namespace stillmesh
