#include <fmt/format.h>
#include <sys/stat.h>

#include <algorithm>
#include <cerrno>
#include <cstring>
#include <fstream>
#include <istream>
#include <nlohmann/json.hpp>

#include "platform/report/report.hpp"
#include "platform/report/report_data.hpp"
#include "platform/report/report_page.hpp"
#include "platform/view/view_files.hpp"

namespace stillmesh {
namespace {

constexpr int kDepthMax = 8;
constexpr std::size_t kRunBytesMax = 64U * 1024 * 1024;  // 150 bytes for each of 32768 frames are 5 MB

// What the page's script relies on: it is of a file that anybody may have written.
[[nodiscard]] bool is_run(const nlohmann::json& json) {
    if (!json.is_object() || json.value("schema", nlohmann::json()) != kReportSchema) return false;
    for (const char* const key : {"input", "limits", "state_hash"}) {
        if (!json.contains(key) || !json[key].is_string()) return false;
    }
    if (!json.contains("numbers") || !json["numbers"].is_array() || !json.contains("columns")) return false;
    for (const nlohmann::json& number : json["numbers"]) {
        if (!number.is_array() || number.size() != 4 || !number[0].is_string() || !number[1].is_string()) return false;
    }
    const nlohmann::json& columns = json["columns"];
    if (!columns.is_object()) return false;
    for (const char* const key :
         {"time", "frame", "state", "reason", "map", "features", "still", "moving", "pose", "ms"}) {
        if (!columns.contains(key) || !columns[key].is_string()) return false;
    }
    return columns.contains("stages") && columns["stages"].is_array() && columns.contains("error");
}

// A '<' only ever stands in a string.
[[nodiscard]] std::string without_tags(std::string text) {
    for (std::size_t at = 0; (at = text.find('<', at)) != std::string::npos;) text.replace(at, 1, "\\u003c");
    return text;
}

// The numbers lie before the pictures: what comes after them is not read. False: they are not there.
[[nodiscard]] bool read_as_far_as_numbers(std::istream& in, std::string& text) {
    std::string part(std::size_t{64} * 1024, '\0');
    std::size_t begin = std::string::npos;
    while (text.size() < kRunBytesMax) {
        in.read(part.data(), static_cast<std::streamsize>(part.size()));
        if (in.gcount() <= 0) return false;
        const std::size_t looked = text.size() > kRunDataBegin.size() ? text.size() - kRunDataBegin.size() : 0;
        text.append(part.data(), static_cast<std::size_t>(in.gcount()));
        if (begin == std::string::npos) begin = text.find(kRunDataBegin, looked);
        if (begin == std::string::npos) continue;
        if (text.find(kDataEnd, std::max(begin + kRunDataBegin.size(), looked)) != std::string::npos) return true;
    }
    return false;
}

}  // namespace

bool take_run(std::string_view page, std::string& data) {
    const std::size_t begin = page.find(kRunDataBegin);
    if (begin == std::string_view::npos) return false;
    const std::size_t from = begin + kRunDataBegin.size();
    const std::size_t end = page.find(kDataEnd, from);
    if (end == std::string_view::npos) return false;
    // What is nested deeper than ours is left out: it would be written by recursion.
    const auto is_shallow = [](int depth, nlohmann::json::parse_event_t, nlohmann::json&) {
        return depth <= kDepthMax;
    };
    const nlohmann::json json = nlohmann::json::parse(page.substr(from, end - from), is_shallow, false);
    if (!is_run(json)) return false;
    // "<!--" would change how a page is read from there on.
    data = without_tags(json.dump(-1, ' ', false, nlohmann::json::error_handler_t::replace));
    return true;
}

Status read_report(const std::string& place, ComparedRun& run, std::string& message) {
    struct stat status {};
    std::string file = place;
    if (::stat(place.c_str(), &status) == 0 && S_ISDIR(status.st_mode)) file += "/index.html";
    std::ifstream in(file, std::ios::binary);
    if (!in) {
        message = fmt::format("{}: cannot be read: {}; give a folder that 'stillmesh run --report' wrote.", file,
                              std::strerror(errno));
        return Status::kUnavailable;
    }
    std::string text;
    if (!read_as_far_as_numbers(in, text) || !take_run(text, run.data)) {
        message = file +
                  ": is no report of a run that this program can read; make it anew with 'stillmesh run --report DIR'.";
        return Status::kInvalid;
    }
    run.name = place;
    while (run.name.size() > 1 && run.name.back() == '/') run.name.pop_back();
    return Status::kOk;
}

std::string comparison_html(const std::vector<ComparedRun>& runs) {
    const PageParts& parts = page_parts();
    std::string html = page_head("Stillmesh: runs side by side");
    html += fmt::format("<header><h1>{} runs side by side</h1></header>\n", runs.size());
    html += parts.compare_body;
    html += "<script type=\"application/json\" id=\"runs\">[";
    for (std::size_t i = 0; i < runs.size(); ++i) {
        const nlohmann::json name = runs[i].name;
        const std::string text = without_tags(name.dump(-1, ' ', true, nlohmann::json::error_handler_t::replace));
        html += fmt::format("{}{{\"name\":{},\"data\":{}}}", i > 0 ? "," : "", text, runs[i].data);
    }
    html += "]";
    html += kDataEnd;
    return html + page_tail({parts.three, parts.words, parts.path, parts.map, parts.run, parts.curves, parts.compare});
}

}  // namespace stillmesh
