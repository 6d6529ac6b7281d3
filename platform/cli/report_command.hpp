// `stillmesh report A/ B/ ...`: runs side by side, of what their reports hold; and the options of a run's own report.
#pragma once

#include <cstdint>
#include <string>
#include <vector>

namespace CLI {
class App;
}

namespace stillmesh {

struct ReportArguments {
    std::vector<std::string> places;  // folders of reports, or their files
    std::string out = "comparison.html";
};

// The command, and --report with --report-frames of a run.
CLI::App* add_report_command(CLI::App& app, ReportArguments& arguments);
void add_report_options(CLI::App& run, std::string& folder, std::uint32_t& frames);

// Exit codes: 0 done; 1 could not be written; 2 something is no report, or bad usage.
[[nodiscard]] int report_command(const ReportArguments& arguments);

}  // namespace stillmesh
