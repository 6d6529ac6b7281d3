#include "hal/bag/bag_files.hpp"

#include <fcntl.h>
#include <sys/stat.h>
#include <unistd.h>

#include <algorithm>
#include <filesystem>
#include <string_view>

#include "hal/calibration/camera_entries.hpp"
#include "hal/calibration/toml_document.hpp"

namespace stillmesh {
namespace {

constexpr std::size_t kMetadataBytesMax = std::size_t{4} << 20U;  // topics with their qualities of service are long
constexpr std::size_t kPartsMax = 100'000;

struct Magic {
    std::string_view bytes;
    BagFormat format;
};
constexpr Magic kMagics[] = {{"#ROSBAG V", BagFormat::kRos1},
                             {std::string_view("SQLite format 3\0", 16), BagFormat::kDb3},
                             {"\x89MCAP", BagFormat::kMcap},
                             {"\x28\xb5\x2f\xfd", BagFormat::kZstd}};

[[nodiscard]] bool is_part(const std::filesystem::path& file) {
    const std::string extension = file.extension().string();
    return extension == ".db3" || extension == ".mcap";
}

// name_2.mcap before name_10.mcap.
[[nodiscard]] bool is_before(const std::string& one, const std::string& other) {
    return one.size() != other.size() ? one.size() < other.size() : one < other;
}

void find_parts(const std::string& folder, std::vector<std::string>& files) {
    std::error_code error;
    for (std::filesystem::directory_iterator at(folder, error), end; !error && at != end; at.increment(error)) {
        if (files.size() < kPartsMax && is_part(at->path())) files.push_back(at->path().string());
    }
    std::sort(files.begin(), files.end(), is_before);
}

}  // namespace

BagFormat bag_format_of(const std::string& file) {
    char bytes[16] = {};
    const int descriptor = ::open(file.c_str(), O_RDONLY | O_CLOEXEC | O_NONBLOCK);
    if (descriptor < 0) return BagFormat::kNone;
    struct stat about {};
    ssize_t count = 0;
    if (::fstat(descriptor, &about) == 0 && S_ISREG(about.st_mode)) count = ::read(descriptor, bytes, sizeof(bytes));
    static_cast<void>(::close(descriptor));
    const std::string_view begin(bytes, count > 0 ? static_cast<std::size_t>(count) : 0);
    for (const Magic& magic : kMagics) {
        if (begin.starts_with(magic.bytes)) return magic.format;
    }
    return BagFormat::kNone;
}

bool is_bag(const std::string& path) {
    std::error_code error;
    if (!std::filesystem::is_directory(path, error)) {
        const std::string extension = std::filesystem::path(path).extension().string();
        return extension == ".bag" || is_part(path) || extension == ".zstd" || bag_format_of(path) != BagFormat::kNone;
    }
    if (std::filesystem::exists(path + "/rgb.txt", error)) return false;
    if (std::filesystem::exists(path + "/metadata.yaml", error)) return true;
    std::vector<std::string> parts;
    find_parts(path, parts);
    return !parts.empty();
}

Status files_of_bag(const std::string& path, std::vector<std::string>& files, std::string& message) {
    files.clear();
    std::error_code error;
    if (!std::filesystem::is_directory(path, error)) {
        files.push_back(path);
        return Status::kOk;
    }
    const std::string metadata = path + "/metadata.yaml";
    if (!std::filesystem::exists(metadata, error)) {
        find_parts(path, files);
        if (!files.empty()) return Status::kOk;
        message = path + ": no .db3 or .mcap file in this folder, nor a metadata.yaml; is it the folder of a bag?";
        return Status::kUnavailable;
    }
    std::string text;
    std::vector<CameraEntry> entries;
    STILLMESH_TRY(read_small_file(metadata, kMetadataBytesMax, text, message));
    STILLMESH_TRY(read_yaml_entries(text, metadata, entries, message));
    constexpr std::string_view kKey = "rosbag2_bagfile_information.relative_file_paths";
    for (const CameraEntry& entry : entries) {
        if (entry.key != kKey) continue;
        for (const std::string& word : entry.words) {
            // Some releases wrote the folder's own name before the file's.
            const std::string name = std::filesystem::path(word).filename().string();
            if (!name.empty() && files.size() < kPartsMax) files.push_back(path + "/" + name);
        }
    }
    if (!files.empty()) return Status::kOk;
    message = metadata + ": names no files under '" + std::string(kKey) + "'; remove it to play all that lie there.";
    return Status::kInvalid;
}

}  // namespace stillmesh
