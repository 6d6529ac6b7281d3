// Words and settings.
#include <cmath>
#include <string>
#include <type_traits>
#include <vector>

#include "platform/c_api/engine_memory.hpp"
#include "platform/cli/configuration_file.hpp"

namespace stillmesh::c_api {
namespace {

constexpr sm_status kNotSet = SM_INVALID;
constexpr const char* kNotSetSentence = "the settings are none: give them their size, then sm_settings_init.";

void write_settings(const Settings& settings, sm_settings* to) noexcept {
    std::memcpy(to->inside, &settings, sizeof(settings));
    to->is_set = kSettingsMark;
}

// Calls visitor(name, value, min, max, unit, sentence) for all keys, those of the limits first.
template <typename Visitor>
void visit_all(Settings& settings, Visitor&& visitor) noexcept {
    visit_limits(settings.limits, visitor);
    visit_parameters(settings.configuration, visitor);
}

[[nodiscard]] sm_status say_problem(sm_problem* out, const ConfigurationProblem& problem) noexcept {
    if (problem.key == nullptr) return say_ok(out);
    return say(out, SM_INVALID, "key '%s' = %g %s; allowed beside the others: %g to %g.", problem.key, problem.value,
               problem.sentence, problem.min, problem.max);
}

template <typename Value>
[[nodiscard]] constexpr std::int32_t kind_of() noexcept {
    if constexpr (std::is_same_v<Value, bool>) return SM_KEY_FLAG;
    return std::is_floating_point_v<Value> ? SM_KEY_REAL : SM_KEY_WHOLE;
}

}  // namespace

[[nodiscard]] sm_status check_settings(const Settings& settings, sm_problem* problem) noexcept {
    const sm_status status = say_problem(problem, validate(settings.limits));
    return status != SM_OK ? status : say_problem(problem, validate(settings.configuration, settings.limits));
}

}  // namespace stillmesh::c_api

using namespace stillmesh;         // NOLINT: the calls stand outside of every namespace
using namespace stillmesh::c_api;  // NOLINT

extern "C" {

const char* sm_version(void) {
#define STILLMESH_WORD(number) #number
#define STILLMESH_WORDS(a, b, c) STILLMESH_WORD(a) "." STILLMESH_WORD(b) "." STILLMESH_WORD(c)
    return STILLMESH_WORDS(STILLMESH_VERSION_MAJOR, STILLMESH_VERSION_MINOR, STILLMESH_VERSION_PATCH);
}
const char* sm_status_name(sm_status status) {
    return status >= SM_OK && status <= SM_END ? status_name(static_cast<Status>(status)) : "unknown";
}
const char* sm_pose_state_name(std::int32_t state) {
    return state >= SM_POSE_NONE && state <= SM_POSE_TRACKED ? pose_state_name(static_cast<PoseState>(state))
                                                             : "unknown";
}
const char* sm_unsure_reason_name(std::int32_t reason) {
    const bool is_known = reason >= 0 && reason < static_cast<std::int32_t>(kUnsureReasons);
    return is_known ? unsure_reason_name(static_cast<UnsureReason>(reason)) : "unknown";
}
const char* sm_stage_name(std::int32_t stage) {
    const bool is_known = stage >= 0 && stage < static_cast<std::int32_t>(kStages);
    return is_known ? stage_name(static_cast<Stage>(stage)) : "unknown";
}

sm_status sm_settings_init(sm_settings* settings, const char* limits, const char* scene, sm_problem* problem) {
    if (settings == nullptr || settings->size < sizeof(sm_settings) || limits == nullptr || scene == nullptr) {
        return say(problem, SM_INVALID, "settings, limits and scene are needed, and settings.size.");
    }
    Settings out;
    if (std::strcmp(limits, "pocket") == 0) {
        out.limits = Limits::pocket();
    } else if (std::strcmp(limits, "tiny") == 0) {
        out.limits = Limits::tiny();
    } else if (std::strcmp(limits, "room") != 0) {
        return say(problem, SM_NOT_FOUND, "limits '%.80s' are unknown: give room, pocket or tiny.", limits);
    }
    if (std::strcmp(scene, "outdoor") == 0) {
        out.configuration = Configuration::outdoor();
    } else if (std::strcmp(scene, "indoor") != 0) {
        return say(problem, SM_NOT_FOUND, "scene '%.80s' is unknown: give indoor or outdoor.", scene);
    }
    out.configuration = out.configuration.fitted_to(out.limits);
    write_settings(out, settings);
    return say_ok(problem);
}

sm_status sm_settings_set(sm_settings* settings, const char* key, double value, sm_problem* problem) {
    Settings out;
    if (!read_settings(settings, out) || key == nullptr) return say(problem, kNotSet, "%s", kNotSetSentence);
    sm_status status = say(problem, SM_NOT_FOUND, "key '%.80s' is unknown; sm_settings_key lists them all.", key);
    visit_all(out, [&](const char* name, auto& target, double min, double max, const char* unit, const char*) {
        using Value = std::remove_reference_t<decltype(target)>;
        if (std::strcmp(name, key) != 0) return;
        const bool is_whole = kind_of<Value>() != SM_KEY_REAL;
        if (!(value >= min && value <= max) || (is_whole && value != std::floor(value))) {
            status = say(problem, SM_INVALID, "key '%s' is %g; it must be %s%g to %g%s%s.", name, value,
                         is_whole ? "a whole number from " : "", min, max, *unit == '\0' ? "" : " ", unit);
            return;
        }
        target = static_cast<Value>(value);
        status = say_ok(problem);
    });
    if (status == SM_OK) write_settings(out, settings);
    return status;
}

sm_status sm_settings_get(const sm_settings* settings, const char* key, double* value) {
    Settings in;
    if (!read_settings(settings, in) || key == nullptr || value == nullptr) return SM_INVALID;
    sm_status status = SM_NOT_FOUND;
    visit_all(in, [&](const char* name, const auto& target, double, double, const char*, const char*) {
        if (std::strcmp(name, key) != 0) return;
        *value = static_cast<double>(target);
        status = SM_OK;
    });
    return status;
}

sm_status sm_settings_read(sm_settings* settings, const char* text, const char* name, sm_problem* problem) {
    Settings out;
    if (!read_settings(settings, out) || text == nullptr || name == nullptr) {
        return say(problem, kNotSet, "%s", kNotSetSentence);
    }
    return guarded(problem, [&] {
        std::string message;
        const auto parameters = parameters_of(out.limits, out.configuration);
        const Status status = apply_configuration(text, name, parameters, message);
        if (status != Status::kOk) return say(problem, static_cast<sm_status>(status), "%s", message.c_str());
        write_settings(out, settings);
        return say_ok(problem);
    });
}

std::size_t sm_settings_write(const sm_settings* settings, char* text, std::size_t bytes) {
    Settings in;
    if (!read_settings(settings, in)) return 0;
    std::size_t length = 0;
    static_cast<void>(guarded(nullptr, [&] {
        const std::string all = configuration_toml(parameters_of(in.limits, in.configuration));
        length = all.size();
        if (text != nullptr && bytes > 0) {
            const std::size_t taken = std::min(length, bytes - 1);
            std::memcpy(text, all.data(), taken);
            text[taken] = '\0';
        }
        return SM_OK;
    }));
    return length;
}

sm_status sm_settings_key(const sm_settings* settings, std::uint32_t index, sm_key* key) {
    Settings in;
    if (!read_settings(settings, in)) return SM_INVALID;
    sm_status status = SM_NOT_FOUND;
    std::uint32_t at = 0;
    visit_all(in, [&](const char* name, const auto& value, double min, double max, const char* unit, const char* what) {
        if (at++ != index) return;
        using Value = std::remove_cvref_t<decltype(value)>;
        status = write_struct({0, kind_of<Value>(), name, unit, what, static_cast<double>(value), min, max}, key);
    });
    return status;
}

sm_status sm_settings_check(const sm_settings* settings, sm_problem* problem) {
    Settings in;
    if (!read_settings(settings, in)) return say(problem, kNotSet, "%s", kNotSetSentence);
    return check_settings(in, problem);
}

}  // extern "C"
