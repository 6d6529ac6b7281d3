#include "hal/replay/replay_camera.hpp"

#include <fcntl.h>
#include <sys/stat.h>
#include <unistd.h>

#include <algorithm>
#include <array>
#include <cerrno>
#include <cstdlib>
#include <cstring>
#include <exception>
#include <filesystem>
#include <utility>

#include "hal/calibration/calibration.hpp"
#include "hal/replay/one_view.hpp"

namespace stillmesh {
namespace {

[[nodiscard]] std::string size_text(const ImageHeader& header) {
    return std::to_string(header.width) + "x" + std::to_string(header.height);
}

}  // namespace

ReplayCamera::ReplayCamera(ReplayOptions options) : options_(std::move(options)) {}

ReplayCamera::~ReplayCamera() {
    close();
}

const CameraInfo& ReplayCamera::info() const noexcept {
    STILLMESH_CHECK(is_open_);
    return info_;
}

Status ReplayCamera::open() noexcept {
    close();
    message_.clear();
    try {
        const Status status = open_folder();
        if (status != Status::kOk) close();
        is_open_ = status == Status::kOk;
        return status;
    } catch (const std::exception& error) {
        close();
        message_ = options_.folder + ": cannot be opened: " + error.what() + ".";
        return Status::kUnavailable;
    }
}

void ReplayCamera::close() noexcept {
    for (int& list : lists_) {
        if (list >= 0) static_cast<void>(::close(list));
        list = -1;
    }
    is_open_ = false;
    next_ = 0;
}

Status ReplayCamera::image_path(int list, const ListedImage& image, std::string& path) {
    std::array<char, kFileNameMax> name{};
    STILLMESH_CHECK(image.name_size <= name.size());
    const ssize_t count = ::pread(lists_[list], name.data(), image.name_size, static_cast<off_t>(image.name_offset));
    if (count != static_cast<ssize_t>(image.name_size)) {
        message_ = list_names_[list] + ": changed while it was being replayed; do not write into a recording in use.";
        return Status::kUnavailable;
    }
    path.clear();
    if (name[0] != '/') path.append(options_.folder).append("/");
    const std::size_t begin = path.size();
    path.append(name.data(), image.name_size);
    // Written by Windows.
    if (path.find('/', begin) == std::string::npos)
        std::replace(path.begin() + static_cast<std::ptrdiff_t>(begin), path.end(), '\\', '/');
    return Status::kOk;
}

Status ReplayCamera::find_calibration() {
    if (options_.camera) {
        info_ = *options_.camera;
        calibration_source_ = "the camera of the recording";
        return Status::kOk;
    }
    calibration_source_ = options_.calibration;
    if (calibration_source_.empty()) {
        for (const char* name : {"camera.toml", "camera.yaml", "camera.yml", "camera.json", "camera_info.yaml",
                                 "calibration.yaml", "calibration.txt", "intrinsics.json"}) {
            const std::string file = options_.folder + "/" + name;
            std::error_code error;
            if (std::filesystem::exists(file, error)) {
                calibration_source_ = file;
                break;
            }
        }
    }
    if (calibration_source_.empty()) {
        message_ = options_.folder +
                   ": no camera.toml or camera.yaml in this folder, and a camera is not guessed; name one with "
                   "--calibration (a file, or";
        for (const std::string_view name : calibration_names()) message_ += " " + std::string(name);
        message_ += ").";
        return Status::kInvalid;
    }
    STILLMESH_TRY(load_calibration(calibration_source_, info_, message_));
    if (options_.depth_units_per_m > 0) info_.depth_units_per_m = options_.depth_units_per_m;
    if (info_.depth_units_per_m > 0) return Status::kOk;
    message_ =
        calibration_source_ +
        ": does not say how many depth units make a metre; give --depth-units N (1000 for millimetres, 5000 in TUM "
        "recordings), or a camera file with a key 'depth_units_per_m'.";
    return Status::kInvalid;
}

Status ReplayCamera::open_folder() {
    std::error_code error;
    if (!std::filesystem::exists(options_.folder, error)) {
        message_ = options_.folder + ": no such folder; give the folder that holds rgb.txt and depth.txt.";
        return Status::kUnavailable;
    }
    if (!std::filesystem::is_directory(options_.folder, error)) {
        message_ = options_.folder + ": is not a folder; give the folder that holds rgb.txt and depth.txt.";
        return Status::kUnavailable;
    }
    counts_ = {};
    STILLMESH_TRY(find_pairs());
    counts_.first_ns = pairs_.front().colour.time_ns;
    counts_.last_ns = pairs_.back().colour.time_ns;
    for (const ImagePair& pair : pairs_) {
        const std::int64_t gap_ns = std::abs(pair.depth.time_ns - pair.colour.time_ns);
        counts_.pair_gap_longest_ns = std::max(counts_.pair_gap_longest_ns, gap_ns);
    }
    for (std::size_t i = 1; i < pairs_.size(); ++i) {
        const std::int64_t gap = pairs_[i].colour.time_ns - pairs_[i - 1].colour.time_ns;
        if (gap > options_.gap_ns) ++counts_.gaps;
        if (gap > counts_.gap_longest_ns) {
            counts_.gap_longest_ns = gap;
            counts_.gap_longest_after_ns = pairs_[i - 1].colour.time_ns;
        }
    }
    STILLMESH_TRY(find_calibration());
    STILLMESH_TRY(find_first_images());
    STILLMESH_TRY(check_images());
    return find_masks();
}

Status ReplayCamera::find_masks() {
    STILLMESH_TRY(masks_.open(options_.masks, options_.folder, message_));
    for (std::size_t i = 0; masks_.is_open() && i < pairs_.size(); ++i) {
        STILLMESH_TRY(image_path(kColour, pairs_[i].colour, path_));
        counts_.masks += masks_.has(path_) ? 1U : 0U;
    }
    if (!masks_.is_open() || counts_.masks > 0) return Status::kOk;
    message_ = masks_.folder() + ": holds no PNG named as a colour image is; name masks so, or give --mask none.";
    return Status::kInvalid;
}

// The first pair whose images can be read says what all are like; those before are skipped when they are polled.
Status ReplayCamera::find_first_images() {
    constexpr std::size_t kTriedMax = 30;
    std::string first_message;
    Status first = Status::kOk;
    for (std::size_t i = 0; i < std::min(pairs_.size(), kTriedMax); ++i) {
        STILLMESH_TRY(image_path(kColour, pairs_[i].colour, colour_file_));
        STILLMESH_TRY(image_path(kDepth, pairs_[i].depth, depth_file_));
        Status status = read_image_header(colour_file_, colour_header_, message_);
        if (status == Status::kOk) status = read_image_header(depth_file_, depth_header_, message_);
        if (status == Status::kOk || status == Status::kInvalid) return status;
        if (i == 0) {
            first = status;
            first_message = message_;
        }
    }
    message_ = first_message;
    return first;
}

Status ReplayCamera::check_images() {
    const auto names_depth = [](const std::string& file) {
        return file.find("depth", file.find_last_of('/', file.find_last_of('/') - 1)) != std::string::npos;
    };
    const bool is_depth = depth_header_.kind == ImageKind::kGrey16;
    if (colour_header_.kind == ImageKind::kGrey16 &&
        (!is_depth || (names_depth(colour_file_) && !names_depth(depth_file_)))) {
        message_ = colour_file_ +
                   ": colour is 16-bit grey here and depth is not as it should be; are rgb.txt and depth.txt "
                   "swapped?";
        return Status::kInvalid;
    }
    if (!is_depth) {
        message_ = depth_file_ + ": depth must be 16-bit grey, this is " + kind_text(depth_header_.kind) +
                   "; save it with its full depth.";
        return Status::kInvalid;
    }
    STILLMESH_TRY(check_sizes());
    const std::size_t pixels = std::size_t{info_.model.width} * info_.model.height;
    counts_.depth_width = depth_header_.width;
    counts_.depth_height = depth_header_.height;
    counts_.is_colour_wide = colour_header_.kind == ImageKind::kGrey16;
    colour_wide_.assign(counts_.is_colour_wide ? pixels : 0, 0);
    colour_pixels_.assign(pixels * (colour_header_.kind == ImageKind::kRgb8 ? 3 : 1), 0);
    depth_pixels_.assign(pixels, 0);
    counts_.is_registered_here = is_of_separate_depth();
    registration_.reset();
    if (counts_.is_registered_here) {
        const SeparateDepth& depth = *info_.separate_depth;
        registration_.emplace(depth.model, info_.model, depth.colour_from_depth, info_.depth_units_per_m);
    }
    info_.separate_depth.reset();
    const bool is_as_colour = !registration_ && depth_header_.width == colour_header_.width;
    depth_read_.assign(is_as_colour ? 0 : std::size_t{depth_header_.width} * depth_header_.height, 0);
    return Status::kOk;
}

Status ReplayCamera::check_sizes() {
    const ImageHeader& colour = colour_header_;
    if (colour.width > options_.width_max || colour.height > options_.height_max) {
        message_ = colour_file_ + ": the images are " + size_text(colour) + ", at most " +
                   std::to_string(options_.width_max) + "x" + std::to_string(options_.height_max) +
                   " are taken; scale the recording and its calibration down.";
        return Status::kInvalid;
    }
    STILLMESH_TRY(check_depth_size());
    CameraModel& model = info_.model;
    if (model.width == 0) {
        model.width = colour.width;
        model.height = colour.height;
    }
    if (model.width != colour.width || model.height != colour.height) {
        message_ = calibration_source_ + ": is for " + std::to_string(model.width) + "x" +
                   std::to_string(model.height) + " pixels, the images are " + size_text(colour) +
                   "; give the calibration of these images.";
        return Status::kInvalid;
    }
    return Status::kOk;
}

bool ReplayCamera::is_of_separate_depth() const noexcept {
    return info_.separate_depth && info_.separate_depth->model.width == depth_header_.width &&
           info_.separate_depth->model.height == depth_header_.height;
}

Status ReplayCamera::check_depth_size() {
    const ImageHeader& colour = colour_header_;
    const ImageHeader& depth = depth_header_;
    if (is_of_separate_depth()) return Status::kOk;
    if (is_of_one_view({colour.width, colour.height}, {depth.width, depth.height})) return Status::kOk;
    message_ = depth_file_ + ": depth is " + size_text(depth) + " but colour is " + size_text(colour);
    if (info_.separate_depth) {
        const CameraModel& model = info_.separate_depth->model;
        message_ += ", and the depth camera of " + calibration_source_ + " has " + std::to_string(model.width) + "x" +
                    std::to_string(model.height) + "; give the camera of these images.";
    } else {
        message_ +=
            "; register depth to colour when recording, or give the depth camera in camera.toml, too "
            "(docs/recordings.md, "
            "\"Two cameras\").";
    }
    return Status::kInvalid;
}

Status ReplayCamera::read_pair(const ImagePair& pair, Frame& frame) {
    STILLMESH_TRY(image_path(kColour, pair.colour, path_));
    const auto bytes_of = [](std::vector<std::uint16_t>& pixels) {
        return std::span(reinterpret_cast<std::uint8_t*>(pixels.data()), pixels.size() * 2);
    };
    STILLMESH_TRY(read_image(path_, colour_header_,
                             colour_wide_.empty() ? std::span<std::uint8_t>(colour_pixels_) : bytes_of(colour_wide_),
                             message_));
    for (std::size_t i = 0; i < colour_wide_.size(); ++i) {
        colour_pixels_[i] = static_cast<std::uint8_t>(colour_wide_[i] >> 8U);
    }
    STILLMESH_TRY(masks_.read(path_, info_.model.width, info_.model.height, frame.mask, message_));
    STILLMESH_TRY(image_path(kDepth, pair.depth, path_));
    STILLMESH_TRY(
        read_image(path_, depth_header_, bytes_of(depth_read_.empty() ? depth_pixels_ : depth_read_), message_));
    const std::uint32_t width = info_.model.width;
    const std::uint32_t height = info_.model.height;
    if (registration_) {
        registration_->reproject({depth_read_.data(), depth_header_.width, depth_header_.height, depth_header_.width},
                                 depth_pixels_.data());
    } else if (!depth_read_.empty()) {
        resize_depth(depth_read_, {depth_header_.width, depth_header_.height}, depth_pixels_, {width, height});
    }
    frame.time_ns = pair.colour.time_ns;
    frame.depth_time_ns = pair.depth.time_ns;
    frame.format = colour_header_.kind == ImageKind::kRgb8 ? PixelFormat::kRgb8 : PixelFormat::kGrey8;
    frame.colour = {colour_pixels_.data(), width, height, std::size_t{width} * channels_of(frame.format)};
    frame.depth = {depth_pixels_.data(), width, height, width};
    frame.depth_units_per_m = info_.depth_units_per_m;
    return Status::kOk;
}

Status ReplayCamera::poll(Frame& frame) noexcept {
    if (!is_open_) return Status::kUnavailable;
    message_.clear();
    if (next_ == pairs_.size()) return Status::kEnd;
    try {
        const Status status = read_pair(pairs_[next_++], frame);
        // A listed image of another kind than the first is broken input as well, not a question of configuration.
        return status == Status::kInvalid ? Status::kCorrupt : status;
    } catch (const std::exception& error) {
        message_ = options_.folder + ": cannot be read: " + error.what() + ".";
        return Status::kUnavailable;
    }
}

Status ReplayCamera::wait(std::uint32_t) noexcept {
    if (!is_open_) return Status::kUnavailable;
    return next_ == pairs_.size() ? Status::kEnd : Status::kOk;
}

}  // namespace stillmesh
