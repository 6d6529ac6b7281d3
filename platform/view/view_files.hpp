// The page and what it loads, as parts of the program: whoever asks for a name gets one of these, and no name reaches
// the file system.
#pragma once

#include <span>
#include <string_view>

namespace stillmesh {

struct ViewFile {
    std::string_view path;  // of the URL
    const char* type;
    std::string_view bytes;
};
[[nodiscard]] std::span<const ViewFile> view_files() noexcept;

}  // namespace stillmesh
