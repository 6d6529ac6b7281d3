// A run as the report's page reads it: JSON in two parts, numbers of each frame (what comparing runs needs, some 150
// bytes a frame), and pictures and map. Columns are base64 of little endian. No '<' is in them: they lie in a page.
#pragma once

#include <string>
#include <string_view>

#include "platform/report/run_film.hpp"
#include "platform/report/run_record.hpp"

namespace stillmesh {

inline constexpr int kReportSchema = 1;
// What stands before the first part in a page, and behind it: how one report finds it in another's file.
inline constexpr std::string_view kRunDataBegin = "<script type=\"application/json\" id=\"run\">";
inline constexpr std::string_view kDataEnd = "</script>";

[[nodiscard]] std::string run_data(const RunRecord& run, const RunFilm& film);
[[nodiscard]] std::string film_data(const RunFilm& film);

}  // namespace stillmesh
