// The last words of a run, for people and for machines.
#pragma once

#include <string>

#include "platform/report/run_record.hpp"

namespace stillmesh {

[[nodiscard]] std::string summary_text(const RunRecord& record, const std::string& report);
[[nodiscard]] std::string summary_json(const RunRecord& record, const std::string& report, int exit_code);
[[nodiscard]] std::string evaluation_text(const Evaluation& evaluation);
[[nodiscard]] std::string evaluation_json(const Evaluation& evaluation);

}  // namespace stillmesh
