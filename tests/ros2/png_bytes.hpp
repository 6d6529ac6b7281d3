// A picture as the bytes of a PNG file.
#pragma once

#include <cstdint>
#include <fstream>
#include <iterator>
#include <string>
#include <vector>

#include "platform/record/png_file.hpp"
#include "tests/support/temporary_folder.hpp"

namespace stillmesh::test {

[[nodiscard]] inline std::vector<std::uint8_t> png_bytes(const void* pixels, std::uint32_t width, std::uint32_t height,
                                                         PngPixels kind) {
    const TemporaryFolder folder;
    if (!write_png_file(folder.path("image.png"), pixels, width, height, kind).empty()) return {};
    std::ifstream file(folder.path("image.png"), std::ios::binary);
    return {std::istreambuf_iterator<char>(file), std::istreambuf_iterator<char>()};
}

}  // namespace stillmesh::test
