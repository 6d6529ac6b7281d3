#include "hal/openni2/stream_modes.hpp"

#include <algorithm>
#include <array>
#include <cstdlib>
#include <optional>
#include <utility>

#include "hal/openni2/file_care.hpp"
#include "hal/openni2/openni2_runtime.hpp"

namespace stillmesh::openni2 {
namespace {

// Images/s that pairing believes in: half a period is at most 33 ms, at least 8.
constexpr int kPairingRateMin = 15;
constexpr int kPairingRateMax = 60;

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

std::uint32_t bytes_per_pixel(openni::PixelFormat format) noexcept {
    switch (format) {
        case openni::PIXEL_FORMAT_RGB888: return 3;
        case openni::PIXEL_FORMAT_GRAY8: return 1;
        default: return 2;
    }
}

std::string mode_text(const openni::VideoMode& mode) {
    return std::to_string(mode.getResolutionX()) + "x" + std::to_string(mode.getResolutionY()) + "@" +
           std::to_string(mode.getFps());
}

void Streams::register_depth(openni::Device& device, bool is_file, Registration wanted) {
    is_registered = wanted == Registration::kNone || (is_file && wanted == Registration::kAuto);
    if (is_file && wanted == Registration::kAuto) {
        notes.emplace_back(
            "an .oni file does not say whether depth is registered to colour: taken as registered; if people have two "
            "outlines, use --registration here.");
    }
    if (!is_file && wanted == Registration::kAuto &&
        device.isImageRegistrationModeSupported(openni::IMAGE_REGISTRATION_DEPTH_TO_COLOR)) {
        is_registered =
            device.setImageRegistrationMode(openni::IMAGE_REGISTRATION_DEPTH_TO_COLOR) == openni::STATUS_OK &&
            device.getImageRegistrationMode() == openni::IMAGE_REGISTRATION_DEPTH_TO_COLOR;
    } else if (!is_file && wanted == Registration::kHere) {
        static_cast<void>(device.setImageRegistrationMode(openni::IMAGE_REGISTRATION_OFF));
    }
}

Status Streams::start_modes(openni::Device& device, bool is_file, const openni::VideoMode& colour_wanted,
                            const openni::VideoMode& depth_wanted, const OpenNi2Options& options,
                            std::string& message) {
    const auto refuse = [&message](Status status, std::string why) {
        message = std::move(why);
        return status;
    };
    notes.clear();
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

    register_depth(device, is_file, options.registration);
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
    period_us = 1'000'000 / std::clamp(std::max(fps, depth_mode.getFps()), kPairingRateMin, kPairingRateMax);
    if (depth.start() == openni::STATUS_OK && colour.start() == openni::STATUS_OK) return Status::kOk;
    const std::string why = extended_error();
    depth.stop();
    colour.stop();
    return refuse(Status::kUnavailable, "its streams do not start: " + why + ".");
}

Status Streams::start_file(openni::Device& device, const std::string& description, const OpenNi2Options& options,
                           std::string& message) {
    openni::PlaybackControl* const playback = device.getPlaybackControl();
    if (playback == nullptr || !play_image_by_image(*playback)) {
        message = description + ": cannot be played frame by frame: " + extended_error() + ".";
        return Status::kInvalid;
    }
    colour_images = playback->getNumberOfFrames(colour);
    depth_images = playback->getNumberOfFrames(depth);
    if (colour_images <= 0 || depth_images <= 0) {
        message = description + ": holds no images of colour or of depth; was its recording cut off?";
        return Status::kInvalid;
    }
    const Status status = start_modes(device, true, colour.getVideoMode(), depth.getVideoMode(), options, message);
    if (status != Status::kOk) message = description + ": " + message;
    return status;
}

Status Streams::start(openni::Device& device, bool is_file, const std::string& description,
                      const OpenNi2Options& options, std::string& message) {
    const auto refuse = [&message](Status status, std::string why) {
        message = std::move(why);
        return status;
    };
    if (!device.hasSensor(openni::SENSOR_DEPTH) || !device.hasSensor(openni::SENSOR_COLOR)) {
        return refuse(Status::kInvalid, description + ": has no " +
                                            (device.hasSensor(openni::SENSOR_DEPTH) ? "colour" : "depth") +
                                            " images; both are needed.");
    }
    if (depth.create(device, openni::SENSOR_DEPTH) != openni::STATUS_OK ||
        colour.create(device, openni::SENSOR_COLOR) != openni::STATUS_OK) {
        return refuse(Status::kUnavailable, description + ": its streams cannot be made: " + extended_error() + ".");
    }
    if (is_file) return start_file(device, description, options, message);
    std::string last = description +
                       ": offers no mode of 640x480 or 320x240 within the limits for colour and depth (colour " +
                       modes_of(colour.getSensorInfo()) + "; depth " + modes_of(depth.getSensorInfo()) + ").";
    struct Size {
        int width, height;
    };
    constexpr Size kLarge{640, 480};
    constexpr Size kSmall{320, 240};
    const auto sizes = width_first == kSmall.width ? std::array{kSmall, kLarge} : std::array{kLarge, kSmall};
    Status last_status = Status::kInvalid;
    // The same size for both; then, where there is none, whatever goes together.
    for (const bool is_mixed : {false, true}) {
        for (const Size& size : sizes) {
            if (size.width > static_cast<int>(options.width_max) ||
                size.height > static_cast<int>(options.height_max)) {
                continue;
            }
            const auto colour_best = best_mode(colour.getSensorInfo(), size.width, size.height, colour_rank);
            for (const Size& depth_size : sizes) {
                if ((depth_size.width == size.width) == is_mixed) continue;
                const auto depth_best =
                    best_mode(depth.getSensorInfo(), depth_size.width, depth_size.height, depth_rank);
                if (!colour_best || !depth_best) continue;
                last_status = start_modes(device, false, *colour_best, *depth_best, options, message);
                if (last_status == Status::kOk) return Status::kOk;
                last = description + ": " + message;
            }
        }
    }
    return refuse(last_status, last);
}

}  // namespace stillmesh::openni2
