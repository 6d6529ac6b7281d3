#include "platform/report/report.hpp"

#include <fmt/format.h>

#include <string_view>

#include "platform/linux/text_output.hpp"
#include "platform/report/report_data.hpp"
#include "platform/report/report_page.hpp"
#include "platform/report/report_tables.hpp"
#include "platform/view/view_files.hpp"

namespace stillmesh {

std::string page_head(std::string_view title) {
    // Even if a name in the data broke out, it could fetch nothing.
    std::string html =
        "<!DOCTYPE html>\n<html lang=\"en\"><head><meta charset=\"utf-8\">"
        "<meta http-equiv=\"Content-Security-Policy\" content=\"default-src 'none'; script-src 'unsafe-inline'; "
        "style-src 'unsafe-inline'; img-src data:; base-uri 'none'; form-action 'none'\">"
        "<meta name=\"viewport\" content=\"width=device-width, initial-scale=1\">"
        "<meta name=\"color-scheme\" content=\"light dark\"><link rel=\"icon\" href=\"data:,\"><title>";
    html += title;
    html += "</title>\n<style>\n";
    html += page_parts().style;
    html += page_parts().report_style;
    return html + "</style></head>\n<body><main>\n";
}

std::string page_tail(std::initializer_list<std::string_view> scripts) {
    std::string html =
        "</main><noscript><p class=\"note\">To play, this page needs JavaScript; it loads none from "
        "elsewhere.</p></noscript>\n";
    for (const std::string_view script : scripts) {
        if (script.empty()) continue;
        html += "<script>\n";
        html += script;
        html += "</script>\n";
    }
    return html + "</body></html>\n";
}

std::string_view part_of(std::string_view page, std::string_view name) {
    constexpr std::string_view kMark = "<!-- part ";
    const std::size_t at = page.find(std::string(kMark) + std::string(name));
    if (at == std::string_view::npos) return {};
    const std::size_t begin = page.find("-->", at) + 3;
    return page.substr(begin, page.find(kMark, begin) - begin);
}

std::string report_html(const RunRecord& run, const RunFilm& film) {
    const PageParts& parts = page_parts();
    std::string html = page_head("Stillmesh report");
    html += fmt::format(
        "<header><h1>Where the camera went</h1><p>{}, {} frames, calibration {}, limits {}, features {}, "
        "state hash {:016x}</p><p class=\"note\"><code>{}</code></p></header>\n",
        escaped(run.input), run.frames_total, escaped(run.calibration), escaped(run.limits), escaped(run.features),
        run.state_hash, escaped(run.command));
    for (const std::string& problem : run.problems) {
        html += "<section class=\"full problem\">" + escaped(problem) + "</section>\n";
    }
    std::string notes;
    for (const std::string& note : run.notes) notes += "<p class=\"note\">Note: " + escaped(note) + "</p>";
    if (!notes.empty()) html += "<section class=\"full\">" + notes + "</section>\n";
    if (film.frames().empty()) return html + "<section class=\"full\">No frame was tracked.</section>" + page_tail({});
    html += report_cards(run);
    html += part_of(parts.page, "state");
    html += part_of(parts.report_body, "player");
    html += part_of(parts.page, "picture");
    html += part_of(parts.page, "map");
    html += part_of(parts.report_body, "curves");
    html += report_tables(run);
    html += kRunDataBegin;
    html += run_data(run, film);
    html += kDataEnd;
    html += "\n<script type=\"application/json\" id=\"film\">";
    html += film_data(film);
    html += kDataEnd;
    return html + page_tail({parts.three, parts.words, parts.picture, parts.path, parts.map, parts.run, parts.curves,
                             parts.report});
}

bool write_report(const RunRecord& record, const RunFilm& film, const std::string& file, std::string& message) {
    return write_whole_file(file, report_html(record, film), message);
}

}  // namespace stillmesh
