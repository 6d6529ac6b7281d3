// The assembler takes the files in, the linker puts them among what is read only.
#include "platform/view/view_files.hpp"

#include <array>

// Global and hidden, as the default vocabulary's names are (platform/vocabulary/default_vocabulary.cpp says why).
#define STILLMESH_VIEW_FILE(name, file)                                                      \
    asm(".pushsection .rodata\n"                                                             \
        ".globl stillmesh_view_" #name "_begin, stillmesh_view_" #name                       \
        "_end\n"                                                                             \
        ".hidden stillmesh_view_" #name "_begin, stillmesh_view_" #name                      \
        "_end\n"                                                                             \
        "stillmesh_view_" #name                                                              \
        "_begin:\n"                                                                          \
        ".incbin \"" file                                                                    \
        "\"\n"                                                                               \
        "stillmesh_view_" #name                                                              \
        "_end:\n"                                                                            \
        ".byte 0\n"                                                                          \
        ".popsection\n");                                                                    \
    extern "C" {                                                                             \
    extern const char stillmesh_view_##name##_begin[] __attribute__((visibility("hidden"))); \
    extern const char stillmesh_view_##name##_end[] __attribute__((visibility("hidden")));   \
    }

STILLMESH_VIEW_FILE(page, STILLMESH_VIEW_FOLDER "/index.html")
STILLMESH_VIEW_FILE(style, STILLMESH_VIEW_FOLDER "/view.css")
STILLMESH_VIEW_FILE(script, STILLMESH_VIEW_FOLDER "/view.js")
STILLMESH_VIEW_FILE(scene, STILLMESH_VIEW_FOLDER "/map.js")
STILLMESH_VIEW_FILE(three, STILLMESH_THREE)

namespace stillmesh {
namespace {

[[nodiscard]] std::string_view between(const char* begin, const char* end) noexcept {
    return {begin, static_cast<std::size_t>(end - begin)};
}

}  // namespace

std::span<const ViewFile> view_files() noexcept {
    static const std::array<ViewFile, 5> kFiles = {{
        {"/", "text/html; charset=utf-8", between(stillmesh_view_page_begin, stillmesh_view_page_end)},
        {"/view.css", "text/css; charset=utf-8", between(stillmesh_view_style_begin, stillmesh_view_style_end)},
        {"/view.js", "text/javascript; charset=utf-8", between(stillmesh_view_script_begin, stillmesh_view_script_end)},
        {"/map.js", "text/javascript; charset=utf-8", between(stillmesh_view_scene_begin, stillmesh_view_scene_end)},
        {"/three.js", "text/javascript; charset=utf-8", between(stillmesh_view_three_begin, stillmesh_view_three_end)},
    }};
    return kFiles;
}

}  // namespace stillmesh
