// The parts of the report that are plain HTML, and legible without a script: the figures at its top, and its tables.
#pragma once

#include <string>

#include "platform/report/run_record.hpp"

namespace stillmesh {

[[nodiscard]] std::string escaped(const std::string& text);
[[nodiscard]] std::string report_cards(const RunRecord& run);
[[nodiscard]] std::string report_tables(const RunRecord& run);

}  // namespace stillmesh
