#include "hal/v4l2/opening.hpp"

#include <algorithm>
#include <cerrno>
#include <cmath>
#include <cstdio>
#include <cstring>

#include "hal/v4l2/pixel_formats.hpp"
#include "hal/v4l2/realsense_device.hpp"

namespace stillmesh::v4l2 {
namespace {

// Images/s that pairing believes in: half a period is at most 33 ms, at least 8.
constexpr double kPairingRateMin = 15, kPairingRateMax = 60;
constexpr double kOtherUnitsPerM = 1000;  // what is sent as Z16 or Y16 is mm, unless the calibration says other
constexpr int kTriesMax = 32;             // of modes
constexpr std::uint32_t kUsb2_mbit_per_s = 480;
// Images/s where every other one is tracked: 30 pictures, each with depth of 17 ms before.
constexpr double kAlternatingRate = 60;

// Controls of the USB Video Class as V4L2 numbers them (linux/v4l2-controls.h).
constexpr std::uint32_t kExposureAuto = 0x009a0901;      // 1: manual, 3: by aperture priority
constexpr std::uint32_t kExposureMaySlow = 0x009a0903;   // 1: in dim light longer than a period
constexpr std::uint32_t kWhiteBalanceAuto = 0x0098090c;  // 0, 1

// The given colour camera for images of that size. False: it is for another shape.
[[nodiscard]] bool scale_given(const CameraModel& given, CameraModel& model) {
    CameraModel scaled = given;
    if (scaled.width == 0) scaled.width = model.width;
    if (scaled.height == 0) scaled.height = model.height;
    if (std::uint64_t{scaled.width} * model.height != std::uint64_t{scaled.height} * model.width) return false;
    const double scale = static_cast<double>(model.width) / scaled.width;
    scaled.fx *= scale;
    scaled.fy *= scale;
    scaled.cx = (scaled.cx + 0.5) * scale - 0.5;
    scaled.cy = (scaled.cy + 0.5) * scale - 0.5;
    scaled.width = model.width;
    scaled.height = model.height;
    model = scaled;
    return true;
}

// Depth has the colour camera's view, perhaps in another size.
void take_as_registered(CameraPair& cameras) {
    const CameraModel& lens = cameras.colour;
    CameraModel depth = lens;
    depth.width = cameras.depth.width;
    depth.height = cameras.depth.height;
    if (depth.width != lens.width || depth.height != lens.height) {
        const double right = static_cast<double>(depth.width) / lens.width;
        const double down = static_cast<double>(depth.height) / lens.height;
        depth.fx *= right;
        depth.fy *= down;
        depth.cx = (lens.cx + 0.5) * right - 0.5;
        depth.cy = (lens.cy + 0.5) * down - 0.5;
    }
    cameras.depth = depth;
    cameras.colour_from_depth = {};
}

[[nodiscard]] std::string size_text(std::uint32_t width, std::uint32_t height) {
    return std::to_string(width) + "x" + std::to_string(height);
}

[[nodiscard]] Status refuse_calibration(const V4l2Node& node, Status status, const std::string& why,
                                        std::string& message) {
    const bool is_gone = status == Status::kUnavailable;
    message = is_gone ? why_not(node.path, ENODEV)
                      : camera_text(node) + ": its calibration cannot be read: " + why +
                            "; unplug it and plug it in again, or give one of your own (--calibration FILE).";
    return is_gone ? status : Status::kInvalid;
}

[[nodiscard]] Identity identity_of(const CameraChoice& choice) {
    const V4l2Node& node = choice.depth.node;
    return {.serial = node.serial,
            .usb_port = node.usb_port,
            .vendor_id = node.vendor_id,
            .product_id = node.product_id,
            .depth_path = node.path,
            .colour_path = choice.colour.node.path,
            .depth_interface = node.interface,
            .colour_interface = choice.colour.node.interface,
            .is_infrared = choice.is_infrared,
            .is_alternating = choice.is_alternating};
}

}  // namespace

void Opening::close() noexcept {
    colour.stop();
    depth.stop();
    colour_metadata.stop();
    depth_metadata.stop();
    for (int* const handle : {&colour_handle_, &depth_handle_}) {
        if (*handle >= 0) link_.close(*handle);
        *handle = -1;
    }
}

Status Opening::start_streams(const CameraChoice& choice, const OpeningWishes& wishes, std::string& message) {
    ModeWishes modes = wishes.modes;
    const V4l2Node& node = choice.depth.node;
    modes.has_y16_depth = realsense_name(node.vendor_id, node.product_id) == nullptr;
    modes.is_one_view = choice.is_infrared;
    if (choice.is_alternating) modes.rate_best = kAlternatingRate;
    const std::vector<ModePair> pairs = rank_modes(choice.depth.modes, choice.colour.modes, modes);
    if (pairs.empty()) {
        message = camera_text(node) + ": offers no modes that can be used within " +
                  size_text(modes.width_max, modes.height_max) + " (colour " + modes_text(choice.colour.modes, false) +
                  "; depth " + modes_text(choice.depth.modes, true) + ").";
        return Status::kInvalid;
    }
    double bytes_per_s_max = INFINITY;
    Status status = Status::kUnavailable;
    int tries = 0;
    for (const ModePair& pair : pairs) {
        if (pair.bytes_per_s() > bytes_per_s_max) continue;
        if (++tries > kTriesMax) break;
        int error = depth.start(depth_handle_, pair.depth);
        const bool is_depth_wrong = error != 0;
        if (error == 0) error = colour.start(colour_handle_, pair.colour);
        if (error == 0) return Status::kOk;
        const ImageStream& wrong = is_depth_wrong ? depth : colour;
        const V4l2Node& wrong_node = is_depth_wrong ? node : choice.colour.node;
        message = error == ERANGE
                      ? wrong_node.path + ": the driver sets another mode than " +
                            mode_text(is_depth_wrong ? pair.depth : pair.colour) + " (" + wrong.step() + ")."
                      : why_not(wrong_node.path, error);
        depth.stop();
        status = error == ERANGE || error == EINVAL ? Status::kInvalid : Status::kUnavailable;
        // The next mode may fit: a smaller one where the bus is full. Else no other will do better.
        if (error == ENOSPC) bytes_per_s_max = 0.8 * pair.bytes_per_s();
        if (error != ENOSPC && status != Status::kInvalid) return status;
    }
    return status;
}

Status Opening::calibrate_realsense(const V4l2Node& node, const OpeningWishes& wishes, Opened& opened,
                                    std::string& message) {
    RealSenseDevice device(link_, depth_handle_);
    CameraPair& cameras = opened.cameras;
    const bool is_given = !wishes.calibration.empty();
    std::string why;
    Status status = Status::kOk;
    if (opened.is_infrared) {
        // Depth is in the left infrared camera's view, and both are rectified.
        if (!is_given) status = device.read_depth(cameras.colour, why);
        if (status != Status::kOk) return refuse_calibration(node, status, why, message);
        take_as_registered(cameras);
    } else if (!wishes.given.separate_depth) {
        RealSenseCalibration read{cameras.depth, cameras.colour, {}};
        status = device.read_depth(read.depth, why);
        if (status == Status::kOk) status = device.read_colour(node.product_id, read, why);
        if (status == Status::kOk) {
            cameras.depth = read.depth;
            cameras.colour_from_depth = read.colour_from_depth;
            if (!is_given) cameras.colour = read.colour;
        } else if (status == Status::kCorrupt && is_given) {
            nominal_depth(node.product_id, cameras.depth, cameras.colour_from_depth);
            opened.notes.push_back("the camera's own calibration cannot be read: " + why +
                                   "; depth is registered as the data sheet's camera sees it, which may be some px "
                                   "off.");
        } else {
            return refuse_calibration(node, status, why, message);
        }
    }
    opened.calibration_source = is_given ? wishes.calibration : "the camera's own";
    status = device.read_depth_units(cameras.depth_units_per_m, why);
    if (status != Status::kOk) {
        cameras.depth_units_per_m = node.product_id == kD405 ? 10'000 : 1000;
        opened.notes.push_back("the depth unit cannot be read (" + why + "): taken for the one it has when new.");
    }
    return Status::kOk;
}

Status Opening::calibrate_other(const OpeningWishes& wishes, Opened& opened, std::string& message) {
    CameraPair& cameras = opened.cameras;
    if (wishes.calibration.empty()) {
        message = opened.description + ": nothing is known of its lens; give its calibration (--calibration FILE).";
        return Status::kInvalid;
    }
    cameras.depth_units_per_m = wishes.given.depth_units_per_m > 0 ? wishes.given.depth_units_per_m : kOtherUnitsPerM;
    opened.calibration_source = wishes.calibration;
    if (wishes.given.separate_depth) return Status::kOk;
    take_as_registered(cameras);
    opened.notes.emplace_back("depth is taken as registered to colour: the calibration names one camera only.");
    return Status::kOk;
}

// What the calibration says of both cameras, in the sizes that stream.
Status Opening::adopt_given(const OpeningWishes& wishes, Opened& opened, std::string& message) {
    CameraPair& cameras = opened.cameras;
    const auto refuse = [&](const CameraModel& given, const CameraModel& model) {
        message = wishes.calibration + ": is for " + size_text(given.width, given.height) +
                  " pixels, the camera gives " + size_text(model.width, model.height) + ".";
        return Status::kInvalid;
    };
    opened.readout_s = wishes.given.readout_s;
    if (!scale_given(wishes.given.model, cameras.colour)) return refuse(wishes.given.model, cameras.colour);
    if (!wishes.given.separate_depth) return Status::kOk;
    const SeparateDepth& depth_given = *wishes.given.separate_depth;
    if (!scale_given(depth_given.model, cameras.depth)) return refuse(depth_given.model, cameras.depth);
    cameras.colour_from_depth = depth_given.colour_from_depth;
    return Status::kOk;
}

void Opening::set_exposure(const OpeningWishes& wishes, Opened& opened) {
    const bool is_fixed = wishes.is_exposure_fixed;
    const int error = link_.set_control(colour_handle_, kExposureAuto, is_fixed ? 1 : 3);
    static_cast<void>(link_.set_control(colour_handle_, kWhiteBalanceAuto, is_fixed ? 0 : 1));
    // Dark images of every instant are worth more than bright ones of every second: the others' depth has no partner.
    static_cast<void>(link_.set_control(colour_handle_, kExposureMaySlow, 0));
    if (error != 0 && is_fixed) opened.notes.emplace_back("this camera's exposure cannot be fixed.");
}

// Before anything streams: the camera refuses it then. One that was left taking turns is told to stop.
Status Opening::set_turns(const CameraChoice& choice, std::string& message) {
    const V4l2Node& node = choice.depth.node;
    if (realsense_name(node.vendor_id, node.product_id) == nullptr) return Status::kOk;
    RealSenseDevice device(link_, depth_handle_);
    std::string why;
    const Status status = device.set_alternating(choice.is_alternating, why);
    if (status == Status::kOk || !choice.is_alternating) return Status::kOk;
    if (status == Status::kUnavailable) return refuse_calibration(node, status, why, message);
    message = camera_text(node) + ": its projector cannot take turns with the images: " + why +
              "; --camera v4l2:ir has it off, --camera v4l2 has colour.";
    return Status::kInvalid;
}

// The projector's dots move with the camera: in an image that is tracked they would hold it in its place.
void Opening::set_emitter(Opened& opened) {
    const bool is_off = opened.is_infrared && !opened.is_alternating;
    std::uint8_t is_on = is_off ? 0 : 1;
    const int error =
        link_.extension(depth_handle_, kRealSenseUnit, kEmitterControl, V4l2Query::kSet, std::span(&is_on, 1));
    if (error != 0 && is_off) {
        opened.notes.emplace_back("the projector cannot be switched off: its dots move with the camera, poses suffer.");
    }
}

// What of it fails is said, and images go without.
void Opening::open_metadata(const CameraChoice& choice) {
    metadata_problem_.clear();
    const auto open = [this](MetadataStream& stream, const std::string& path) {
        if (metadata_problem_.empty()) note_metadata(path, stream.open(path));
    };
    open(depth_metadata, choice.depth_metadata);
    open(colour_metadata, choice.colour_metadata);
}

// After the images' start, which may try several modes: the first images go without.
void Opening::start_metadata(const CameraChoice& choice, Opened& opened) {
    if (metadata_problem_.empty()) note_metadata(choice.depth_metadata, depth_metadata.start());
    if (metadata_problem_.empty()) note_metadata(choice.colour_metadata, colour_metadata.start());
    if (!metadata_problem_.empty()) {
        opened.notes.push_back(metadata_problem_);
    } else if (!depth_metadata.has_blocks() || !colour_metadata.has_blocks()) {
        // Linux 6.1 knows one model (D4M), and takes another for it when it is told to.
        char told[80];
        std::snprintf(told, sizeof(told), "echo %04x %04x e 8086 0b03 | sudo tee /sys/bus/usb/drivers/uvcvideo/new_id",
                      static_cast<unsigned>(choice.depth.node.vendor_id),
                      static_cast<unsigned>(choice.depth.node.product_id));
        opened.notes.push_back(
            "this kernel hands out the camera's times, and neither exposures nor the projector's state; for all of "
            "it: " +
            std::string(told) + ", and plug the camera in again.");
    }
}

// Half of it is of no use.
void Opening::note_metadata(const std::string& path, int error) {
    if (error == 0) return;
    depth_metadata.stop();
    colour_metadata.stop();
    metadata_problem_ =
        "the camera's own times cannot be read (" +
        (error == ENOTSUP ? "the kernel has no node of metadata for it" : path + ": " + std::strerror(error)) +
        "): images have the times at which the driver got them.";
}

Status Opening::open(const OpeningWishes& wishes, Opened& opened, std::string& message) {
    close();
    opened = {};
    const CameraChoice choice = choose_camera(link_, wishes.device, wishes.known);
    message = choice.message;
    if (choice.status != Status::kOk) return choice.status;
    const V4l2Node& node = choice.depth.node;
    for (const bool is_depth_node : {true, false}) {
        const std::string& path = is_depth_node ? node.path : choice.colour.node.path;
        if (const int error = link_.open(path, is_depth_node ? depth_handle_ : colour_handle_); error != 0) {
            message = why_not(path, error);
            return Status::kUnavailable;
        }
    }
    const bool is_realsense = realsense_name(node.vendor_id, node.product_id) != nullptr;
    STILLMESH_TRY(set_turns(choice, message));
    if (is_realsense) open_metadata(choice);
    STILLMESH_TRY(start_streams(choice, wishes, message));
    opened.identity = identity_of(choice);
    opened.description = camera_text(node);
    opened.is_infrared = choice.is_infrared;
    opened.is_alternating = choice.is_alternating;
    CameraPair& cameras = opened.cameras;
    cameras.depth.width = depth.format().width;
    cameras.depth.height = depth.format().height;
    cameras.colour.width = colour.format().width;
    cameras.colour.height = colour.format().height;
    if (!wishes.calibration.empty()) STILLMESH_TRY(adopt_given(wishes, opened, message));
    STILLMESH_TRY(is_realsense ? calibrate_realsense(node, wishes, opened, message)
                               : calibrate_other(wishes, opened, message));
    if (wishes.is_registered) take_as_registered(cameras);
    const bool is_taken = wishes.is_registered || (!is_realsense && !wishes.given.separate_depth);
    set_exposure(wishes, opened);
    if (is_realsense) set_emitter(opened);
    if (is_realsense) start_metadata(choice, opened);
    if (opened.is_alternating && !(depth_metadata.has_blocks() && colour_metadata.has_blocks())) {
        message = opened.description + ": which images have the projector's dots is not known: " + opened.notes.back() +
                  " Or take --camera v4l2:ir, or v4l2.";
        return Status::kInvalid;
    }
    const double depth_rate = depth.mode().frames_per_s();
    opened.frames_per_s = colour.mode().frames_per_s();
    if (std::abs(depth_rate - opened.frames_per_s) > 0.5) {
        opened.notes.push_back("colour and depth come at different rates (" + mode_text(colour.mode()) + ", " +
                               mode_text(depth.mode()) + "): what finds no partner is dropped.");
    }
    if (is_realsense && node.speed_mbit_per_s != 0 && node.speed_mbit_per_s <= kUsb2_mbit_per_s) {
        opened.notes.emplace_back(
            "it is connected as USB 2, which leaves it its smaller modes; use a USB 3 port and cable.");
    }
    const double rate = std::clamp(std::max(depth_rate, opened.frames_per_s), kPairingRateMin, kPairingRateMax);
    opened.period_us = static_cast<std::int64_t>(1e6 / rate);
    opened.apart_us = opened.period_us / 2;
    if (opened.is_alternating) {
        // Depth of the image before, and half a period more where times are the driver's.
        opened.apart_us = opened.period_us * 3 / 2;
        opened.period_us *= 2;
        opened.frames_per_s /= 2;
    }
    opened.description += ", " + mode_text(colour.mode()) + ", depth " + mode_text(depth.mode()) +
                          (opened.is_alternating ? ", in the left infrared camera's view, its projector takes turns"
                           : opened.is_infrared  ? ", in the left infrared camera's view"
                           : is_taken            ? ", taken as registered"
                                                 : ", registered here");
    return Status::kOk;
}

}  // namespace stillmesh::v4l2
