// A TOML file as a flat list of keys and plain values: all that camera files and configurations need. One place knows
// the TOML library (toml++), and none of its types or exceptions leaves it. Any bytes are safe.
#pragma once

#include <cstdint>
#include <string>
#include <string_view>
#include <variant>
#include <vector>

#include "engine/base/status.hpp"

namespace stillmesh {

struct TomlEntry {
    std::string key;  // tables joined with points: "tracking.features"
    std::variant<bool, std::int64_t, double, std::string> value;
};

// In the order of the file's tables (sorted by key). kInvalid: not TOML, or a value that is a list, a date or
// not in a table; `message` names file, line and problem.
[[nodiscard]] Status parse_toml_document(std::string_view text, const std::string& file,
                                         std::vector<TomlEntry>& entries, std::string& message);

// A whole file, at most `bytes_max`. kUnavailable: cannot be read; kInvalid: too long.
[[nodiscard]] Status read_small_file(const std::string& file, std::size_t bytes_max, std::string& text,
                                     std::string& message);

}  // namespace stillmesh
