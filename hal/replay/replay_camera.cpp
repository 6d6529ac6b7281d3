#include "hal/replay/replay_camera.hpp"

#include <fcntl.h>
#include <sys/stat.h>
#include <unistd.h>

#include <array>
#include <cerrno>
#include <cstring>
#include <exception>
#include <filesystem>
#include <utility>

#include "hal/calibration/calibration.hpp"

namespace stillmesh {
namespace {

constexpr int kColour = 0;
constexpr int kDepth = 1;

[[nodiscard]] std::string size_text(const PngHeader& header) {
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

namespace {

constexpr off_t kListBytesMax = off_t{256} << 20U;  // two days at 30 images a second

}  // namespace

Status ReplayCamera::read_list(const char* name, std::string& text, std::vector<ListedImage>& images) {
    const std::string file = options_.folder + "/" + name;
    int& list = lists_[std::strcmp(name, "rgb.txt") == 0 ? kColour : kDepth];
    list = ::open(file.c_str(), O_RDONLY | O_CLOEXEC | O_NONBLOCK);  // a pipe must not let us wait
    struct stat about {};
    if (list < 0 || ::fstat(list, &about) != 0 || !S_ISREG(about.st_mode)) {
        message_ = file + ": " + (list < 0 ? std::strerror(errno) : "not a file") +
                   "; a recording needs rgb.txt and depth.txt with lines 'seconds file'.";
        return Status::kUnavailable;
    }
    if (about.st_size > kListBytesMax) {
        message_ = file + ": is larger than a list of images can be (" + std::to_string(kListBytesMax >> 20U) +
                   " MiB); is it the right file?";
        return Status::kInvalid;
    }
    text.resize(static_cast<std::size_t>(about.st_size));
    std::size_t read_bytes = 0;
    while (read_bytes < text.size()) {
        const ssize_t count = ::read(list, text.data() + read_bytes, text.size() - read_bytes);
        if (count < 0 && errno == EINTR) continue;
        if (count <= 0) {
            message_ = file + ": cannot be read; is the disk still there?";
            return Status::kUnavailable;
        }
        read_bytes += static_cast<std::size_t>(count);
    }
    STILLMESH_TRY(parse_image_list(text, file, images, message_));
    if (images.empty()) {
        message_ = file + ": the list is empty; a recording needs lines 'seconds file'.";
        return Status::kInvalid;
    }
    return Status::kOk;
}

Status ReplayCamera::image_path(int list, const ListedImage& image, std::string& path) {
    std::array<char, kFileNameMax> name{};
    STILLMESH_CHECK(image.name_size <= name.size());
    const ssize_t count = ::pread(lists_[list], name.data(), image.name_size, static_cast<off_t>(image.name_offset));
    if (count != static_cast<ssize_t>(image.name_size)) {
        message_ = options_.folder + (list == kColour ? "/rgb.txt" : "/depth.txt") +
                   ": changed while it was being replayed; do not write into a recording in use.";
        return Status::kUnavailable;
    }
    path.clear();
    if (name[0] != '/') path.append(options_.folder).append("/");
    path.append(name.data(), image.name_size);
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
        for (const char* name : {"camera.toml", "camera.yaml", "camera.yml"}) {
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
    return load_calibration(calibration_source_, info_, message_);
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
    {
        std::string text;
        std::vector<ListedImage> colour;
        std::vector<ListedImage> depth;
        STILLMESH_TRY(read_list("rgb.txt", text, colour));
        STILLMESH_TRY(read_list("depth.txt", text, depth));
        pairs_ = associate(colour, depth, options_.association_gap_max_ns);
        counts_.colour_images = static_cast<std::uint32_t>(colour.size());
        counts_.depth_images = static_cast<std::uint32_t>(depth.size());
        counts_.frames = static_cast<std::uint32_t>(pairs_.size());
    }
    if (pairs_.empty()) {
        message_ = options_.folder +
                   ": no colour image has a depth image within 20 ms; do rgb.txt and depth.txt share one clock?";
        return Status::kInvalid;
    }
    counts_.first_ns = pairs_.front().colour.time_ns;
    counts_.last_ns = pairs_.back().colour.time_ns;
    for (std::size_t i = 1; i < pairs_.size(); ++i) {
        const std::int64_t gap = pairs_[i].colour.time_ns - pairs_[i - 1].colour.time_ns;
        if (gap > options_.gap_ns) ++counts_.gaps;
        if (gap > counts_.gap_longest_ns) {
            counts_.gap_longest_ns = gap;
            counts_.gap_longest_after_ns = pairs_[i - 1].colour.time_ns;
        }
    }
    STILLMESH_TRY(find_calibration());

    std::string colour_file;
    std::string depth_file;
    STILLMESH_TRY(image_path(kColour, pairs_[0].colour, colour_file));
    STILLMESH_TRY(image_path(kDepth, pairs_[0].depth, depth_file));
    STILLMESH_TRY(read_png_header(colour_file, colour_header_, message_));
    STILLMESH_TRY(read_png_header(depth_file, depth_header_, message_));
    if (colour_header_.kind == PngKind::kGrey16) {
        message_ =
            colour_file + ": colour must be 8-bit grey or RGB, this is 16-bit; are rgb.txt and depth.txt swapped?";
        return Status::kInvalid;
    }
    if (depth_header_.kind != PngKind::kGrey16) {
        message_ = depth_file + ": depth must be a 16-bit grey PNG; save it with its full depth.";
        return Status::kInvalid;
    }
    if (colour_header_.width != depth_header_.width || colour_header_.height != depth_header_.height) {
        message_ = depth_file + ": depth is " + size_text(depth_header_) + " but colour is " +
                   size_text(colour_header_) + "; register depth to colour when recording.";
        return Status::kInvalid;
    }
    if (colour_header_.width > options_.width_max || colour_header_.height > options_.height_max) {
        message_ = colour_file + ": the images are " + size_text(colour_header_) + ", the limits allow " +
                   std::to_string(options_.width_max) + "x" + std::to_string(options_.height_max) +
                   "; scale the recording and its calibration down.";
        return Status::kInvalid;
    }
    CameraModel& model = info_.model;
    if (model.width == 0) {
        model.width = colour_header_.width;
        model.height = colour_header_.height;
    }
    if (model.width != colour_header_.width || model.height != colour_header_.height) {
        message_ = calibration_source_ + ": is for " + std::to_string(model.width) + "x" +
                   std::to_string(model.height) + " pixels, the images are " + size_text(colour_header_) +
                   "; give the calibration of these images.";
        return Status::kInvalid;
    }
    const std::size_t pixels = std::size_t{model.width} * model.height;
    colour_pixels_.assign(pixels * bytes_per_pixel(colour_header_.kind), 0);
    depth_pixels_.assign(pixels, 0);
    return Status::kOk;
}

Status ReplayCamera::read_pair(const ImagePair& pair, Frame& frame) {
    STILLMESH_TRY(image_path(kColour, pair.colour, path_));
    STILLMESH_TRY(read_png(path_, colour_header_, colour_pixels_, message_));
    STILLMESH_TRY(image_path(kDepth, pair.depth, path_));
    STILLMESH_TRY(read_png(path_, depth_header_,
                           {reinterpret_cast<std::uint8_t*>(depth_pixels_.data()), depth_pixels_.size() * 2},
                           message_));
    const std::uint32_t width = info_.model.width;
    const std::uint32_t height = info_.model.height;
    frame.time_ns = pair.colour.time_ns;
    frame.depth_time_ns = pair.depth.time_ns;
    frame.format = colour_header_.kind == PngKind::kRgb8 ? PixelFormat::kRgb8 : PixelFormat::kGrey8;
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
