// What is in the folder: lists, one list of both, or images that are called after their times.
#include <fcntl.h>
#include <sys/mman.h>
#include <sys/stat.h>
#include <unistd.h>

#include <algorithm>
#include <cerrno>
#include <cstring>
#include <filesystem>
#include <string_view>

#include "hal/replay/image_folder.hpp"
#include "hal/replay/replay_camera.hpp"

namespace stillmesh {
namespace {

constexpr off_t kListBytesMax = off_t{256} << 20U;  // two days at 30 images a second

}  // namespace

Status ReplayCamera::read_file(int list, const std::string& file, std::string& text) {
    list_names_[list] = file;
    int& descriptor = lists_[list];
    descriptor = ::open(file.c_str(), O_RDONLY | O_CLOEXEC | O_NONBLOCK);  // a pipe must not let us wait
    struct stat about {};
    if (descriptor < 0 || ::fstat(descriptor, &about) != 0 || !S_ISREG(about.st_mode)) {
        message_ = file + ": " + (descriptor < 0 ? std::strerror(errno) : "not a file") +
                   "; a recording needs rgb.txt and depth.txt with lines 'seconds file', or both in associations.txt, "
                   "or images in folders rgb and depth.";
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
        const ssize_t count = ::read(descriptor, text.data() + read_bytes, text.size() - read_bytes);
        if (count < 0 && errno == EINTR) continue;
        if (count <= 0) {
            message_ = file + ": cannot be read; is the disk still there?";
            return Status::kUnavailable;
        }
        read_bytes += static_cast<std::size_t>(count);
    }
    return Status::kOk;
}

// As if the folder of images had a list: names are read from it when needed.
Status ReplayCamera::read_images(int list, const char* name, std::string& text) {
    const std::string folder = options_.folder + "/" + name;
    list_names_[list] = folder;
    text = list_of_images(options_.folder, name, list == kDepth);
    int& descriptor = lists_[list];
    descriptor = ::memfd_create("list", MFD_CLOEXEC);
    std::size_t written = 0;
    while (descriptor >= 0 && written < text.size()) {
        const ssize_t count = ::write(descriptor, text.data() + written, text.size() - written);
        if (count < 0 && errno == EINTR) continue;
        if (count <= 0) break;
        written += static_cast<std::size_t>(count);
    }
    if (descriptor >= 0 && written == text.size()) return Status::kOk;
    message_ = folder + ": there is no memory for a list of its images.";
    return Status::kUnavailable;
}

Status ReplayCamera::read_list(int list, const char* name, std::vector<ListedImage>& images, ListTimes& times) {
    const std::string file = options_.folder + "/" + name;
    std::string text;
    const bool is_folder = !std::string_view(name).ends_with(".txt");
    STILLMESH_TRY(is_folder ? read_images(list, name, text) : read_file(list, file, text));
    STILLMESH_TRY(parse_image_list(text, file, images, message_, times));
    if (images.empty()) {
        message_ = file + (is_folder ? ": no image in it has a number or a time for a name."
                                     : ": the list is empty; a recording needs lines 'seconds file'.");
        return Status::kInvalid;
    }
    return Status::kOk;
}

Status ReplayCamera::find_pairs() {
    std::error_code error;
    if (std::filesystem::exists(options_.folder + "/rgb.txt", error)) return pair_lists("rgb.txt", "depth.txt");
    for (const char* const name : {"associations.txt", "associate.txt", "associated.txt", "association.txt"}) {
        const std::string file = options_.folder + "/" + name;
        if (std::filesystem::exists(file, error)) return read_associations(file);
    }
    // One list of two is a recording that has lost the other.
    if (std::filesystem::exists(options_.folder + "/depth.txt", error)) return pair_lists("rgb.txt", "depth.txt");
    if (const std::string file = only_associations_in(options_.folder); !file.empty()) return read_associations(file);
    const char* const colour = first_folder_in(options_.folder, kColourFolders);
    const char* const depth = first_folder_in(options_.folder, kDepthFolders);
    if (colour != nullptr && depth != nullptr) return pair_lists(colour, depth);
    if (const char* const both = mixed_folder_in(options_.folder)) return pair_lists(both, both);
    return pair_lists("rgb.txt", "depth.txt");
}

Status ReplayCamera::read_associations(const std::string& file) {
    std::string text;
    ListTimes times{.frames_per_s = options_.frames_per_s};
    STILLMESH_TRY(read_file(kDepth, file, text));  // open twice: each list has its descriptor
    STILLMESH_TRY(read_file(kColour, file, text));
    STILLMESH_TRY(parse_associations(text, file, pairs_, message_, times));
    if (pairs_.empty()) {
        message_ = file + ": the list is empty; its lines are 'seconds colour-file seconds depth-file'.";
        return Status::kInvalid;
    }
    counts_.unit = times.unit;
    counts_.step = times.step;
    counts_.colour_images = counts_.depth_images = counts_.frames = static_cast<std::uint32_t>(pairs_.size());
    return Status::kOk;
}

Status ReplayCamera::pair_lists(const char* colour_list, const char* depth_list) {
    std::vector<ListedImage> colour, depth;
    ListTimes times{.frames_per_s = options_.frames_per_s};
    ListTimes depth_times = times;
    STILLMESH_TRY(read_list(kColour, colour_list, colour, times));
    STILLMESH_TRY(read_list(kDepth, depth_list, depth, depth_times));
    for (ListedImage& image : depth)
        image.time_ns = std::max<std::int64_t>(image.time_ns - options_.depth_offset_ns, 0);
    pairs_ = associate(colour, depth, options_.association_gap_max_ns);
    counts_.unit = times.unit;
    counts_.step = times.step;
    counts_.colour_images = static_cast<std::uint32_t>(colour.size());
    counts_.depth_images = static_cast<std::uint32_t>(depth.size());
    counts_.frames = static_cast<std::uint32_t>(pairs_.size());
    if (!pairs_.empty()) return Status::kOk;
    message_ = options_.folder + ": " + why_no_pairs(colour, depth, options_.association_gap_max_ns);
    return Status::kInvalid;
}

}  // namespace stillmesh
