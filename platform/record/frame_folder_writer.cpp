#include "platform/record/frame_folder_writer.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <filesystem>
#include <new>
#include <system_error>

#include "hal/calibration/calibration.hpp"
#include "platform/evaluation/trajectory.hpp"
#include "platform/record/png_file.hpp"

namespace stillmesh {

FrameFolderWriter::FrameFolderWriter(std::size_t slots) : ring_(slots) {}

FrameFolderWriter::~FrameFolderWriter() {
    static_cast<void>(close());
}

bool FrameFolderWriter::make_folder(const CameraInfo& camera, std::string& message) {
    const std::string& folder = folder_;
    const std::filesystem::path path(folder);
    std::error_code error;
    std::filesystem::create_directories(path, error);
    const bool is_empty = !error && std::filesystem::is_empty(path, error);
    if (!error && !is_empty) {
        message = folder + ": is not empty; give a new folder for the frames, nothing was changed.";
        return false;
    }
    for (const char* name : {"rgb", "depth"}) {
        if (!error) std::filesystem::create_directory(path / name, error);
    }
    if (error) {
        message = folder + ": cannot be made: " + error.message() + ".";
        return false;
    }
    return colour_list_.open((path / "rgb.txt").string(), message) &&
           depth_list_.open((path / "depth.txt").string(), message) &&
           colour_list_.write("# timestamp filename\n", message) &&
           depth_list_.write("# timestamp filename\n", message) &&
           write_whole_file((path / "camera.toml").string(), calibration_toml(camera), message);
}

bool FrameFolderWriter::open(const std::string& folder, const CameraInfo& camera, std::string& message) {
    folder_ = folder;
    if (folder.size() > 5 && folder.ends_with(".mcap")) bag_.emplace();
    if (!(bag_ ? bag_->open(folder, camera, message) : make_folder(camera, message))) return false;
    const std::size_t pixels = std::size_t{camera.model.width} * camera.model.height;
    for (Slot& slot : ring_.slots()) {
        slot.colour.resize(3 * pixels);
        slot.depth.resize(pixels);
    }
    try {
        thread_ = std::jthread([this] { write_all(); });
    } catch (const std::system_error& failure) {
        message = fmt::format("{}: there is no thread to write it: {}.", folder, failure.what());
        return false;
    }
    is_open_ = true;
    return true;
}

void FrameFolderWriter::add(const Frame& frame) {
    if (!is_open_) return;
    Slot* const slot = missed_ > 0 || has_failed_ ? nullptr : ring_.claim();
    const std::uint32_t channels = channels_of(frame.format);
    const std::size_t row_bytes = std::size_t{frame.colour.width} * channels;
    // A frame that is not the camera's is refused by the engine; it is not for this folder either.
    if (slot == nullptr || row_bytes * frame.colour.height > slot->colour.size() ||
        std::size_t{frame.depth.width} * frame.depth.height > slot->depth.size()) {
        ++missed_;
        return;
    }
    slot->frame = frame;
    for (std::uint32_t y = 0; y < frame.colour.height; ++y) {
        std::copy_n(frame.colour.row(y), row_bytes, slot->colour.data() + y * row_bytes);
    }
    for (std::uint32_t y = 0; y < frame.depth.height; ++y) {
        std::copy_n(frame.depth.row(y), frame.depth.width, slot->depth.data() + std::size_t{y} * frame.depth.width);
    }
    const ImageView<std::uint8_t>& mask = frame.mask;
    slot->mask.resize(mask.data == nullptr ? 0 : std::size_t{mask.width} * mask.height);
    for (std::uint32_t y = 0; !slot->mask.empty() && y < mask.height; ++y) {
        std::copy_n(mask.row(y), mask.width, slot->mask.data() + std::size_t{y} * mask.width);
    }
    ++frames_;
    ring_.publish();
}

std::string FrameFolderWriter::write(const Slot& slot) {
    const Frame& frame = slot.frame;
    if (bag_) {
        Frame packed = frame;
        packed.colour.data = slot.colour.data();
        packed.depth.data = slot.depth.data();
        std::string problem;
        static_cast<void>(bag_->write(packed, problem));
        return problem;
    }
    const std::string colour_time = time_text(frame.time_ns);
    const std::string depth_time = time_text(frame.depth_time_ns);
    const std::string colour = "rgb/" + colour_time + ".png";
    const std::string depth = "depth/" + depth_time + ".png";
    std::string problem =
        write_png_file(folder_ + "/" + colour, slot.colour.data(), frame.colour.width, frame.colour.height,
                       frame.format == PixelFormat::kGrey8 ? PngPixels::kGrey8 : PngPixels::kRgb8);
    if (problem.empty()) {
        problem = write_png_file(folder_ + "/" + depth, slot.depth.data(), frame.depth.width, frame.depth.height,
                                 PngPixels::kGrey16);
    }
    if (problem.empty() && !slot.mask.empty()) {
        std::error_code error;
        std::filesystem::create_directory(folder_ + "/mask", error);
        problem = write_png_file(folder_ + "/mask/" + colour_time + ".png", slot.mask.data(), frame.mask.width,
                                 frame.mask.height, PngPixels::kGrey8);
    }
    if (!problem.empty()) return problem;
    static_cast<void>(depth_list_.write(depth_time + " " + depth + "\n", problem) &&
                      colour_list_.write(colour_time + " " + colour + "\n", problem));
    return problem;
}

void FrameFolderWriter::write_all() {
    while (Slot* const slot = ring_.wait()) {
        if (!has_failed_) {
            if (slot->frame.format == PixelFormat::kBgr8) {  // PNG knows one order only
                for (std::size_t i = 0; i + 2 < slot->colour.size(); i += 3) {
                    std::swap(slot->colour[i], slot->colour[i + 2]);
                }
            }
            try {
                error_ = write(*slot);
            } catch (const std::bad_alloc&) {
                error_ = "no memory left.";  // so short that it asks for none
            }
            if (!error_.empty()) has_failed_ = true;
        }
        ring_.release();
    }
}

std::string FrameFolderWriter::close() {
    if (!is_open_) return {};
    is_open_ = false;
    ring_.close();
    thread_.join();
    colour_list_.close();
    depth_list_.close();
    std::string problem;
    const bool is_closed = !bag_ || bag_->close(problem);
    if (has_failed_) {
        return error_ +
               (bag_ ? " The frames before are whole." : " The frames listed in rgb.txt and depth.txt are whole.");
    }
    if (!is_closed) return problem + " It has every frame, and no index.";
    if (missed_ > 0) {
        return fmt::format(
            "{}: the disk was too slow for the frames: it ends after {} frames, {} later ones were "
            "tracked without it.",
            folder_, frames_, missed_);
    }
    return {};
}

}  // namespace stillmesh
