// Configurations as TOML: every key is one of the engine's parameters, by name; what is unknown, of the wrong type or
// out of its range is refused with file, key, value and allowed range, before anything starts.
#pragma once

#include <cstdint>
#include <span>
#include <string>
#include <string_view>
#include <variant>
#include <vector>

#include "engine/base/status.hpp"
#include "engine/configuration.hpp"
#include "engine/limits.hpp"

namespace stillmesh {

// One parameter of a configuration, pointing into it.
struct ParameterView {
    std::string name;
    std::variant<bool*, std::int32_t*, std::uint32_t*, std::int64_t*, std::uint64_t*, float*, double*> target;
    double min = 0;
    double max = 0;
    std::string unit;      // empty: none
    std::string sentence;  // what it does
};

// Every key of the engine, those of the limits first. Points into both.
[[nodiscard]] std::vector<ParameterView> parameters_of(Limits& limits, Configuration& configuration);

// Nothing is changed unless all of the file is good.
[[nodiscard]] Status apply_configuration(std::string_view toml, const std::string& file,
                                         std::span<const ParameterView> parameters, std::string& message);
// One "key=value" of a command line, by the same rules; `source` stands for the file in messages.
[[nodiscard]] Status apply_assignment(const std::string& assignment, const std::string& source,
                                      std::span<const ParameterView> parameters, std::string& message);
// A file with every key, its value, range and meaning; apply_configuration reads it back to the same bits.
[[nodiscard]] std::string configuration_toml(std::span<const ParameterView> parameters);

}  // namespace stillmesh
