#include "platform/cli/report_command.hpp"

#include <CLI/CLI.hpp>

#include "platform/cli/complaint.hpp"
#include "platform/cli/destinations.hpp"
#include "platform/cli/exit_code.hpp"
#include "platform/linux/text_output.hpp"
#include "platform/report/report.hpp"

namespace stillmesh {

CLI::App* add_report_command(CLI::App& app, ReportArguments& arguments) {
    CLI::App* const command = app.add_subcommand("report", "compare runs side by side, of their reports");
    command->add_option("reports", arguments.places, "folders that 'stillmesh run --report' wrote, two to six")
        ->required()
        ->expected(2, static_cast<int>(kComparedRunsMax))
        ->type_name("DIR");
    command->add_option("--out", arguments.out, "page to write (comparison.html)")->type_name("FILE");
    command->footer("Exit codes: 0 done; 1 could not be written; 2 something is no report, or bad usage.");
    return command;
}

void add_report_options(CLI::App& run, std::string& folder, std::uint32_t& frames) {
    constexpr const char* kGroup = "What comes out";
    CLI::Option* const report =
        run.add_option("--report", folder, "a page that plays the run: DIR/index.html, one file (docs/report.md)")
            ->type_name("DIR")
            ->group(kGroup);
    run.add_option("--report-frames", frames,
                   "pictures in the report at most, spread over the run, some 40 KB each (default 100; 0: none)")
        ->check(CLI::Range(std::uint32_t{0}, kFilmPicturesMax).description(""))
        ->type_name("N")
        ->needs(report)
        ->group(kGroup);
}

int report_command(const ReportArguments& arguments) {
    std::vector<Origin> origins;
    for (const std::string& place : arguments.places) {
        origins.push_back({"report", place});
        origins.push_back({"report", place + "/index.html"});
    }
    const Destination to[] = {{"--out", arguments.out, DestinationKind::kWhole}};
    if (const std::string problem = check_destinations(to, origins); !problem.empty()) return refuse(problem);
    std::vector<ComparedRun> runs;
    std::string message;
    for (const std::string& place : arguments.places) {
        if (read_report(place, runs.emplace_back(), message) != Status::kOk) return refuse(message);
    }
    if (!write_whole_file(arguments.out, comparison_html(runs), message)) {
        complain(message);
        return kExitFailed;
    }
    return answer(arguments.out + "\n");
}

}  // namespace stillmesh
