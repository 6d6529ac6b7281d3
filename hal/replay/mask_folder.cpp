#include "hal/replay/mask_folder.hpp"

#include <unistd.h>

#include <algorithm>
#include <filesystem>

#include "hal/replay/image_reader.hpp"

namespace stillmesh {

Status MaskFolder::open(const std::string& masks, const std::string& recording, std::string& message) {
    folder_.clear();
    if (masks == "none") return Status::kOk;
    const std::string folder = masks.empty() ? recording + "/mask" : masks;
    std::error_code error;
    if (std::filesystem::is_directory(folder, error)) {
        folder_ = folder;
        return Status::kOk;
    }
    if (masks.empty()) return Status::kOk;
    message = folder + ": is no folder of masks; give one with a PNG for each colour image, of its name.";
    return Status::kInvalid;
}

void MaskFolder::name_of(const std::string& colour_file) {
    const std::size_t slash = colour_file.rfind('/');
    const std::size_t begin = slash == std::string::npos ? 0 : slash + 1;
    const std::size_t dot = colour_file.rfind('.');
    const std::size_t end = dot == std::string::npos || dot < begin ? colour_file.size() : dot;
    file_.assign(folder_).append("/").append(colour_file, begin, end - begin).append(".png");
}

bool MaskFolder::has(const std::string& colour_file) {
    if (!is_open()) return false;
    name_of(colour_file);
    return ::access(file_.c_str(), F_OK) == 0;
}

Status MaskFolder::read(const std::string& colour_file, std::uint32_t width, std::uint32_t height,
                        ImageView<std::uint8_t>& mask, std::string& message) {
    mask = {};
    if (!has(colour_file)) return Status::kOk;
    ImageHeader header;
    STILLMESH_TRY(read_image_header(file_, header, message));
    if (header.width != width || header.height != height || header.kind == ImageKind::kGrey16) {
        message = file_ + ": is " + std::to_string(header.width) + "x" + std::to_string(header.height) + " in " +
                  kind_text(header.kind) + ", a mask is an 8-bit image of the pictures' size, " +
                  std::to_string(width) + "x" + std::to_string(height) + "; convert it, or give --mask none.";
        return Status::kInvalid;
    }
    const std::size_t channels = header.kind == ImageKind::kRgb8 ? 3 : 1;
    const std::size_t pixels = std::size_t{width} * height;
    pixels_.resize(pixels * channels);
    STILLMESH_TRY(read_image(file_, header, pixels_, message));
    for (std::size_t i = 0; channels == 3 && i < pixels; ++i) {  // in place: pixel i is read before it is written over
        const std::uint8_t* const at = &pixels_[3 * i];
        pixels_[i] = std::max({at[0], at[1], at[2]});
    }
    mask = {pixels_.data(), width, height, width};
    return Status::kOk;
}

}  // namespace stillmesh
