// What a sm_engine is: the engine's block and beside it what stands between C and the engine's ports, all in the
// caller's memory. And how structs of older and newer headers are read and written: by their own size.
#pragma once

#include <algorithm>
#include <cstdarg>
#include <cstddef>
#include <cstdint>
#include <cstdio>
#include <cstring>

#include "engine/engine.hpp"
#include "platform/c_api/ports.hpp"
#include "platform/c_api/stillmesh.h"

namespace stillmesh::c_api {

// What a settings struct holds.
struct Settings {
    Limits limits;
    Configuration configuration;
};
constexpr std::uint32_t kSettingsMark = 0x534d5331;  // in is_set: whoever forgot to initialise is told so
static_assert(sizeof(Settings) <= sizeof(sm_settings::inside));

// False: NULL, or never initialised.
[[nodiscard]] inline bool read_settings(const sm_settings* from, Settings& settings) noexcept {
    if (from == nullptr || from->size < sizeof(sm_settings) || from->is_set != kSettingsMark) return false;
    std::memcpy(static_cast<void*>(&settings), from->inside, sizeof(settings));
    return true;
}

// A struct whose size the caller says: what its header does not have is 0.
template <typename T>
[[nodiscard]] bool read_struct(const T* from, T& to) noexcept {
    to = T{};
    if (from == nullptr || from->size < 2 * sizeof(std::uint32_t)) return false;
    std::memcpy(&to, from, std::min<std::size_t>(from->size, sizeof(T)));
    return true;
}
template <typename T>
[[nodiscard]] sm_status write_struct(T from, T* to) noexcept {
    if (to == nullptr || to->size < 2 * sizeof(std::uint32_t)) return SM_INVALID;
    from.size = to->size;
    std::memcpy(to, &from, std::min<std::size_t>(to->size, sizeof(T)));
    return SM_OK;
}

// The status, and the sentence into the problem if there is one.
[[gnu::format(printf, 3, 4)]] inline sm_status say(sm_problem* problem, sm_status status, const char* format,
                                                   ...) noexcept {
    if (problem == nullptr || problem->size < sizeof(sm_problem)) return status;
    problem->status = status;
    std::va_list arguments;
    va_start(arguments, format);
    std::vsnprintf(problem->sentence, sizeof(problem->sentence), format, arguments);
    va_end(arguments);
    return status;
}
inline sm_status say_ok(sm_problem* problem) noexcept {
    return say(problem, SM_OK, "%s", "");
}
// A call with this in its body lets no exception out.
template <typename Call>
[[nodiscard]] sm_status guarded(sm_problem* problem, Call&& call) noexcept {
    try {
        return call();
    } catch (...) {
        return say(problem, SM_UNAVAILABLE, "the system has no memory left for this.");
    }
}

[[nodiscard]] inline sm_transform transform_of(const RigidTransform& from) noexcept {
    sm_transform to;
    std::copy_n(from.rotation_xyzw, 4, to.rotation_xyzw);
    std::copy_n(from.translation_m, 3, to.translation_m);
    return to;
}

}  // namespace stillmesh::c_api

struct sm_engine {
    stillmesh::Engine* engine = nullptr;
    stillmesh::Limits limits;
    stillmesh::CameraModel camera;
    stillmesh::c_api::Extractor extractor;
    stillmesh::c_api::Store store;
    sm_stage_function on_stage = nullptr;
    void* stage_user = nullptr;
};
