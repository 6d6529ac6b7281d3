// The pages and what they load, as parts of the program: who asks the server for a name gets one of view_files(), and
// no name reaches the file system; a report is one file made of page_parts().
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

struct PageParts {
    std::string_view page;  // of the view; what lies between "<!-- part NAME" and the next is in the report, too
    std::string_view style, report_style;
    std::string_view words, picture, path, map, run, curves;
    std::string_view report_body, report;
    std::string_view compare_body, compare;
    std::string_view three;  // empty: a build without it, STILLMESH_WITH_THREE
};
[[nodiscard]] const PageParts& page_parts() noexcept;

}  // namespace stillmesh
