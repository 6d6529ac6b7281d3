// One page about one run, for people who would rather look than read: a single HTML file with everything inside,
// nothing is fetched. It plays the run: pictures with the mesh, the map, curves, all at the moment of a slider; it is
// made of the same scripts as the live page (platform/view/page). Without a build's three.js it has no map. Cost: 1 MB,
// 100 bytes a frame and some 40 KB a picture; a tenth of a second, after the run.
#pragma once

#include <string>
#include <string_view>
#include <vector>

#include "engine/base/status.hpp"
#include "platform/report/run_film.hpp"
#include "platform/report/run_record.hpp"

namespace stillmesh {

[[nodiscard]] std::string report_html(const RunRecord& run, const RunFilm& film);
// False: `message` says why; an older report is then left as it was.
[[nodiscard]] bool write_report(const RunRecord& record, const RunFilm& film, const std::string& file,
                                std::string& message);

// One page that lays runs side by side, of the numbers in their reports.
inline constexpr std::size_t kComparedRunsMax = 6;
struct ComparedRun {
    std::string name;
    std::string data;  // run_data() of it
};
// The numbers of a report, by whoever it was written: checked, and without a '<'. False: it has none that can be read.
[[nodiscard]] bool take_run(std::string_view page, std::string& data);
// The numbers of the report in a file, or in a folder's index.html. kOk, kInvalid, kUnavailable: `message` says why.
[[nodiscard]] Status read_report(const std::string& place, ComparedRun& run, std::string& message);
[[nodiscard]] std::string comparison_html(const std::vector<ComparedRun>& runs);

}  // namespace stillmesh
