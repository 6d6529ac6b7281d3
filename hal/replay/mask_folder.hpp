// Masks beside a recording's pictures: for each colour image a PNG of the same name and size in another folder, white
// (from 128 on) where a detector saw what may move. A picture without one has none; detectors may be slow. Memory: one
// image. Cost: one look for the file and one PNG a frame.
#pragma once

#include <cstdint>
#include <string>
#include <vector>

#include "engine/base/status.hpp"
#include "engine/frame/image_view.hpp"

namespace stillmesh {

class MaskFolder {
public:
    // `masks`: the folder; empty: `recording`/mask, if it is there; "none": no masks. kInvalid: it is no folder.
    [[nodiscard]] Status open(const std::string& masks, const std::string& recording, std::string& message);
    [[nodiscard]] bool is_open() const noexcept { return !folder_.empty(); }
    [[nodiscard]] const std::string& folder() const noexcept { return folder_; }
    [[nodiscard]] bool has(const std::string& colour_file);
    // Of this picture, valid until the next; no data: it has none. kInvalid: of another size, or no 8-bit image.
    // kCorrupt, kUnavailable: it cannot be read.
    [[nodiscard]] Status read(const std::string& colour_file, std::uint32_t width, std::uint32_t height,
                              ImageView<std::uint8_t>& mask, std::string& message);

private:
    void name_of(const std::string& colour_file);

    std::string folder_, file_;  // empty: none
    std::vector<std::uint8_t> pixels_;
};

}  // namespace stillmesh
