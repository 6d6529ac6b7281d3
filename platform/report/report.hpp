// One page about one run, for people who would rather look than read: a single HTML file with everything inside (no
// script, font or picture is fetched). Cost: some 2 MB, a tenth of a second, after the run.
#pragma once

#include <string>

#include "platform/report/run_record.hpp"

namespace stillmesh {

[[nodiscard]] std::string report_html(const RunRecord& run);
// False: `message` says why; an older report is then left as it was.
[[nodiscard]] bool write_report(const RunRecord& record, const std::string& file, std::string& message);

}  // namespace stillmesh
