#include <fmt/format.h>
#include <sys/stat.h>

#include <cerrno>
#include <cstring>
#include <fstream>
#include <nlohmann/json.hpp>

#include "platform/report/report.hpp"
#include "platform/report/report_data.hpp"
#include "platform/report/report_page.hpp"
#include "platform/view/view_files.hpp"

namespace stillmesh {
namespace {

constexpr std::size_t kRunBytesMax = 64U * 1024 * 1024;  // 150 bytes for each of 32768 frames are 5 MB

// The first part of the data lies before the pictures: what comes after is not read.
[[nodiscard]] Status read_run_data(const std::string& file, std::string& data, std::string& message) {
    std::ifstream in(file, std::ios::binary);
    if (!in) {
        message = fmt::format("{}: cannot be read: {}; give a folder that 'stillmesh run --report' wrote.", file,
                              std::strerror(errno));
        return Status::kUnavailable;
    }
    std::string text, part(std::size_t{64} * 1024, '\0');
    std::size_t begin = std::string::npos;
    while (text.size() < kRunBytesMax &&
           (in.read(part.data(), static_cast<std::streamsize>(part.size())), in.gcount() > 0)) {
        const std::size_t looked = text.size() > kRunDataBegin.size() ? text.size() - kRunDataBegin.size() : 0;
        text.append(part.data(), static_cast<std::size_t>(in.gcount()));
        if (begin == std::string::npos) begin = text.find(kRunDataBegin, looked);
        if (begin == std::string::npos) continue;
        const std::size_t from = begin + kRunDataBegin.size();
        const std::size_t end = text.find(kDataEnd, std::max(from, looked));
        if (end == std::string::npos) continue;
        data = text.substr(from, end - from);
        return Status::kOk;
    }
    message =
        file + ": is no report of a run that this program can read; make it anew with 'stillmesh run --report DIR'.";
    return Status::kInvalid;
}

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

}  // namespace

Status read_report(const std::string& place, ComparedRun& run, std::string& message) {
    struct stat status {};
    std::string file = place;
    if (::stat(place.c_str(), &status) == 0 && S_ISDIR(status.st_mode)) file += "/index.html";
    std::string data;
    STILLMESH_TRY(read_run_data(file, data, message));
    const nlohmann::json json = nlohmann::json::parse(data, nullptr, false);
    if (!is_run(json)) {
        message =
            file + ": its numbers are not of this version, or broken; make it anew with 'stillmesh run --report DIR'.";
        return Status::kInvalid;
    }
    run.name = place;
    while (run.name.size() > 1 && run.name.back() == '/') run.name.pop_back();
    // Of a file that anybody may have written: "<!--" would change how a page is read from there on.
    run.data = without_tags(json.dump());
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
