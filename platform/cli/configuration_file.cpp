#include "platform/cli/configuration_file.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <type_traits>
#include <utility>
#include <vector>

#include "hal/calibration/calibration.hpp"
#include "hal/calibration/toml_document.hpp"

namespace stillmesh {
namespace {

[[nodiscard]] std::string range_text(const ParameterView& parameter) {
    if (std::holds_alternative<bool*>(parameter.target)) return "true or false";
    return fmt::format("{} to {}{}{}", parameter.min, parameter.max, parameter.unit.empty() ? "" : " ", parameter.unit);
}

[[nodiscard]] std::string value_text(const TomlEntry& entry) {
    return std::visit(
        [](const auto& value) {
            if constexpr (std::is_same_v<std::decay_t<decltype(value)>, std::string>) {
                return fmt::format("\"{}\"", value.substr(0, 80));
            } else {
                return fmt::format("{}", value);
            }
        },
        entry.value);
}

// The number that `entry` gives to `parameter`; false: wrong type or range.
[[nodiscard]] bool number_for(const ParameterView& parameter, const TomlEntry& entry, double& number) {
    if (std::holds_alternative<bool*>(parameter.target)) {
        const bool* const flag = std::get_if<bool>(&entry.value);
        if (flag != nullptr) number = *flag ? 1 : 0;
        return flag != nullptr;
    }
    const bool is_real =
        std::holds_alternative<float*>(parameter.target) || std::holds_alternative<double*>(parameter.target);
    if (const auto* const whole = std::get_if<std::int64_t>(&entry.value)) {
        number = static_cast<double>(*whole);
    } else if (const auto* const real = std::get_if<double>(&entry.value); real != nullptr && is_real) {
        number = *real;
    } else {
        return false;
    }
    // NaN compares false.
    return number >= parameter.min && number <= parameter.max;
}

}  // namespace

std::vector<ParameterView> parameters_of(Limits& limits, Configuration& configuration) {
    std::vector<ParameterView> parameters;
    const auto add = [&parameters](const char* name, auto& value, double min, double max, const char* unit,
                                   const char* sentence) {
        parameters.push_back({name, &value, min, max, unit, sentence});
    };
    visit_limits(limits, add);
    visit_parameters(configuration, add);
    return parameters;
}

Status apply_configuration(std::string_view toml, const std::string& file, std::span<const ParameterView> parameters,
                           std::string& message) {
    std::vector<TomlEntry> entries;
    STILLMESH_TRY(parse_toml_document(toml, file, entries, message));
    std::vector<std::pair<const ParameterView*, double>> changes;
    for (const TomlEntry& entry : entries) {
        const auto parameter = std::find_if(parameters.begin(), parameters.end(),
                                            [&entry](const ParameterView& p) { return p.name == entry.key; });
        if (parameter == parameters.end()) {
            std::vector<std::string_view> known;
            for (const ParameterView& p : parameters) known.push_back(p.name);
            const std::string_view nearest = nearest_name(entry.key, known);
            message =
                fmt::format("{}: key '{}' (value {}) is unknown; ", file, entry.key.substr(0, 80), value_text(entry));
            message += nearest.empty() ? std::string("'stillmesh run --print-config' lists them all.")
                                       : fmt::format("did you mean '{}'?", nearest);
            return Status::kInvalid;
        }
        double number = 0;
        if (!number_for(*parameter, entry, number)) {
            const bool is_whole = !std::holds_alternative<bool*>(parameter->target) &&
                                  !std::holds_alternative<float*>(parameter->target) &&
                                  !std::holds_alternative<double*>(parameter->target);
            message = fmt::format("{}: key '{}' is {}; it must be {}{}.", file, entry.key, value_text(entry),
                                  is_whole ? "a whole number from " : "", range_text(*parameter));
            return Status::kInvalid;
        }
        changes.emplace_back(&*parameter, number);
    }
    for (const auto& [parameter, number] : changes) {
        std::visit(
            [value = number](auto* target) {
                using Type = std::remove_pointer_t<decltype(target)>;
                if constexpr (std::is_same_v<Type, bool>) {
                    *target = value != 0;
                } else {
                    *target = static_cast<Type>(value);
                }
            },
            parameter->target);
    }
    return Status::kOk;
}

Status apply_assignment(const std::string& assignment, const std::string& source,
                        std::span<const ParameterView> parameters, std::string& message) {
    const std::size_t equals = assignment.find('=');
    if (equals == 0 || equals == std::string::npos || equals + 1 == assignment.size() ||
        assignment.find_first_of("\n\r") != std::string::npos) {
        message = fmt::format("{}: '{}' is not of the form key=value.", source, assignment.substr(0, 80));
        return Status::kInvalid;
    }
    return apply_configuration(assignment, source, parameters, message);
}

std::string configuration_toml(std::span<const ParameterView> parameters) {
    std::string text = "# every parameter with its value: change what you need, delete the rest\n";
    for (const ParameterView& parameter : parameters) {
        const std::string value = std::visit(
            [](const auto* target) {
                std::string number = fmt::format("{}", *target);
                // TOML tells whole numbers from others by the point.
                if constexpr (std::is_floating_point_v<std::decay_t<decltype(*target)>>) {
                    if (number.find_first_of(".en") == std::string::npos) number += ".0";
                }
                return number;
            },
            parameter.target);
        text += fmt::format("{} = {}  # {}: {}\n", parameter.name, value, range_text(parameter), parameter.sentence);
    }
    return text;
}

}  // namespace stillmesh
