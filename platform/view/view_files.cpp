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
STILLMESH_VIEW_FILE(words, STILLMESH_VIEW_FOLDER "/words.js")
STILLMESH_VIEW_FILE(picture, STILLMESH_VIEW_FOLDER "/picture.js")
STILLMESH_VIEW_FILE(path, STILLMESH_VIEW_FOLDER "/path.js")
STILLMESH_VIEW_FILE(scene, STILLMESH_VIEW_FOLDER "/map.js")
STILLMESH_VIEW_FILE(control, STILLMESH_VIEW_FOLDER "/control.js")
STILLMESH_VIEW_FILE(script, STILLMESH_VIEW_FOLDER "/view.js")
STILLMESH_VIEW_FILE(report_body, STILLMESH_VIEW_FOLDER "/report.html")
STILLMESH_VIEW_FILE(report_style, STILLMESH_VIEW_FOLDER "/report.css")
STILLMESH_VIEW_FILE(run, STILLMESH_VIEW_FOLDER "/run.js")
STILLMESH_VIEW_FILE(curves, STILLMESH_VIEW_FOLDER "/curves.js")
STILLMESH_VIEW_FILE(report, STILLMESH_VIEW_FOLDER "/report.js")
STILLMESH_VIEW_FILE(compare_body, STILLMESH_VIEW_FOLDER "/compare.html")
STILLMESH_VIEW_FILE(compare, STILLMESH_VIEW_FOLDER "/compare.js")
#ifdef STILLMESH_THREE
STILLMESH_VIEW_FILE(three, STILLMESH_THREE)
#endif

namespace stillmesh {
namespace {

constexpr const char* kHtml = "text/html; charset=utf-8";
constexpr const char* kStyle = "text/css; charset=utf-8";
constexpr const char* kScript = "text/javascript; charset=utf-8";

#define STILLMESH_VIEW_BYTES(name)                  \
    std::string_view(stillmesh_view_##name##_begin, \
                     static_cast<std::size_t>(stillmesh_view_##name##_end - stillmesh_view_##name##_begin))

}  // namespace

std::span<const ViewFile> view_files() noexcept {
    static const std::array kFiles = {
        ViewFile{"/", kHtml, STILLMESH_VIEW_BYTES(page)},
        ViewFile{"/view.css", kStyle, STILLMESH_VIEW_BYTES(style)},
        ViewFile{"/words.js", kScript, STILLMESH_VIEW_BYTES(words)},
        ViewFile{"/picture.js", kScript, STILLMESH_VIEW_BYTES(picture)},
        ViewFile{"/path.js", kScript, STILLMESH_VIEW_BYTES(path)},
        ViewFile{"/map.js", kScript, STILLMESH_VIEW_BYTES(scene)},
        ViewFile{"/control.js", kScript, STILLMESH_VIEW_BYTES(control)},
        ViewFile{"/view.js", kScript, STILLMESH_VIEW_BYTES(script)},
        ViewFile{"/three.js", kScript, page_parts().three},
    };
    return kFiles;
}

const PageParts& page_parts() noexcept {
    static const PageParts kParts = {
        .page = STILLMESH_VIEW_BYTES(page),
        .style = STILLMESH_VIEW_BYTES(style),
        .report_style = STILLMESH_VIEW_BYTES(report_style),
        .words = STILLMESH_VIEW_BYTES(words),
        .picture = STILLMESH_VIEW_BYTES(picture),
        .path = STILLMESH_VIEW_BYTES(path),
        .map = STILLMESH_VIEW_BYTES(scene),
        .run = STILLMESH_VIEW_BYTES(run),
        .curves = STILLMESH_VIEW_BYTES(curves),
        .report_body = STILLMESH_VIEW_BYTES(report_body),
        .report = STILLMESH_VIEW_BYTES(report),
        .compare_body = STILLMESH_VIEW_BYTES(compare_body),
        .compare = STILLMESH_VIEW_BYTES(compare),
#ifdef STILLMESH_THREE
        .three = STILLMESH_VIEW_BYTES(three),
#else
        .three = {},
#endif
    };
    return kParts;
}

}  // namespace stillmesh
