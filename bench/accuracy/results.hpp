// Results as text that programs read, and back.
#pragma once

#include <string>
#include <string_view>
#include <vector>

#include "bench/accuracy/runs.hpp"

namespace stillmesh::accuracy {

[[nodiscard]] std::string to_text(const Result& result);  // one line of JSON
[[nodiscard]] bool from_text(std::string_view text, Result& result);
[[nodiscard]] std::string to_text(const std::vector<Result>& results);  // a JSON array, one a line
[[nodiscard]] bool from_text(std::string_view text, std::vector<Result>& results);

}  // namespace stillmesh::accuracy
