// Making an engine, and giving it frames.
#include <new>

#include "platform/c_api/engine_memory.hpp"
#include "platform/linux/cpu_kernels.hpp"
#include "platform/vocabulary/vocabulary_file.hpp"

namespace stillmesh::c_api {

[[nodiscard]] sm_status check_settings(const Settings& settings, sm_problem* problem) noexcept;  // settings_calls.cpp

namespace {

constexpr std::size_t kHeadBytes = align_up(sizeof(sm_engine), kArenaAlignment);

struct Options {
    sm_options options{};
    sm_extractor extractor{};
    sm_store store{};
};

[[nodiscard]] sm_status read_options(const sm_options* from, Options& to, sm_problem* problem) noexcept {
    if (from == nullptr) {
        to.options.vocabulary = default_vocabulary().data();
        to.options.vocabulary_bytes = default_vocabulary().size();
        return SM_OK;
    }
    if (!read_struct(from, to.options)) return say(problem, SM_INVALID, "the options have no size.");
    if (to.options.extractor != nullptr) {
        const bool is_read = read_struct(to.options.extractor, to.extractor);
        if (!is_read || to.extractor.extract == nullptr || to.extractor.number == 0 || to.extractor.number > 255) {
            return say(problem, SM_INVALID, "the extractor lacks its size, its function, or a number from 1 to 255.");
        }
    }
    if (to.options.store != nullptr) {
        const bool is_read = read_struct(to.options.store, to.store);
        if (!is_read || to.store.content == nullptr || to.store.keep == nullptr || to.store.ask == nullptr ||
            to.store.poll == nullptr || to.store.note_use == nullptr) {
            return say(problem, SM_INVALID, "the store lacks its size or one of its functions.");
        }
    }
    return SM_OK;
}

[[nodiscard]] CameraModel camera_of(const sm_camera& c) noexcept {
    CameraModel out;
    out.width = c.width;
    out.height = c.height;
    out.fx = c.fx;
    out.fy = c.fy;
    out.cx = c.cx;
    out.cy = c.cy;
    out.k1 = c.k1;
    out.k2 = c.k2;
    out.p1 = c.p1;
    out.p2 = c.p2;
    out.k3 = c.k3;
    out.k4 = c.k4;
    out.k5 = c.k5;
    out.k6 = c.k6;
    out.lens = c.lens == SM_LENS_BROWN || c.lens == SM_LENS_FISHEYE ? static_cast<Lens>(c.lens) : Lens{255};
    return out;
}

// What Engine::create refuses and validate() does not name.
[[nodiscard]] sm_status why_not_created(Status status, const Settings& settings, const Options& options,
                                        sm_problem* problem) noexcept {
    if (status == Status::kCorrupt) {
        Vocabulary vocabulary;
        const char* sentence = "is not one";
        static_cast<void>(vocabulary.open(
            {static_cast<const std::byte*>(options.options.vocabulary), options.options.vocabulary_bytes},
            settings.limits.vocabulary_words_max, sentence));
        return say(problem, SM_CORRUPT, "the vocabulary: %s.", sentence);
    }
    if (options.options.store != nullptr && settings.limits.store_features_max == 0) {
        return say(problem, SM_INVALID, "key 'limits.store_features_max' is 0: a store needs room for its regions.");
    }
    return say(problem, static_cast<sm_status>(status), "the engine was not created: %s.", status_name(status));
}

void on_stage(void* user, Stage stage, bool is_begin) noexcept {
    const auto& engine = *static_cast<const sm_engine*>(user);
    engine.on_stage(engine.stage_user, static_cast<std::int32_t>(stage), is_begin ? 1 : 0);
}

// Why the engine refused it.
[[nodiscard]] const char* why_refused(const sm_frame& f, const CameraModel& camera, bool has_hint) noexcept {
    const std::size_t channels = f.format == SM_GREY8 ? 1 : 3;
    if (f.format != SM_GREY8 && f.format != SM_RGB8 && f.format != SM_BGR8)
        return "format is none of SM_GREY8, SM_RGB8, SM_BGR8";
    if (f.colour == nullptr || f.depth == nullptr) return "colour or depth is NULL";
    if (f.width != camera.width || f.height != camera.height) return "its size is not the camera's";
    if (f.colour_stride_bytes < channels * f.width) return "colour_stride_bytes is less than a row";
    if (f.depth_stride_bytes < 2 * std::size_t{f.width} || f.depth_stride_bytes % 2 != 0)
        return "depth_stride_bytes is less than a row, or odd";
    if (!(f.depth_units_per_m > 0 && f.depth_units_per_m < 1e9)) return "depth_units_per_m is no factor";
    if (f.mask != nullptr && f.mask_stride_bytes < f.width) return "mask_stride_bytes is less than a row";
    if (f.time_ns < 0) return "time_ns is negative";
    return has_hint ? "time_ns is not after the last frame's, or the hint has what is no number or no unit quaternion"
                    : "time_ns is not after the last frame's";
}

}  // namespace
}  // namespace stillmesh::c_api

using namespace stillmesh;         // NOLINT: the calls stand outside of every namespace
using namespace stillmesh::c_api;  // NOLINT

extern "C" {

const void* sm_default_vocabulary(std::size_t* bytes) {
    if (bytes != nullptr) *bytes = default_vocabulary().size();
    return default_vocabulary().data();
}

std::size_t sm_engine_bytes(const sm_settings* settings) {
    Settings in;
    if (!read_settings(settings, in) || check_settings(in, nullptr) != SM_OK) return 0;
    // Wherever the caller's memory begins.
    return kArenaAlignment - 1 + kHeadBytes + bytes_needed(in.limits);
}

sm_status sm_engine_create(void* memory, std::size_t bytes, const sm_settings* settings, const sm_camera* camera,
                           const sm_options* options, sm_engine** engine, sm_problem* problem) {
    Settings in;
    sm_camera c;
    Options parts;
    if (memory == nullptr || engine == nullptr) return say(problem, SM_INVALID, "memory or engine is NULL.");
    if (!read_settings(settings, in)) return say(problem, SM_INVALID, "the settings are none: call sm_settings_init.");
    if (!read_struct(camera, c)) return say(problem, SM_INVALID, "camera is NULL or has no size.");
    if (const sm_status status = read_options(options, parts, problem); status != SM_OK) return status;
    if (const sm_status status = check_settings(in, problem); status != SM_OK) return status;
    const CameraModel model = camera_of(c);
    if (const ConfigurationProblem wrong = validate(model, in.limits); wrong.key != nullptr) {
        return say(problem, SM_INVALID, "'%s' = %g %s; allowed: %g to %g.", wrong.key, wrong.value, wrong.sentence,
                   wrong.min, wrong.max);
    }
    const std::size_t needed = sm_engine_bytes(settings);
    if (bytes < needed) return say(problem, SM_FULL, "the memory has %zu bytes, %zu are needed.", bytes, needed);
    const std::size_t past = reinterpret_cast<std::uintptr_t>(memory) % kArenaAlignment;
    std::byte* const begin = static_cast<std::byte*>(memory) + (past == 0 ? 0 : kArenaAlignment - past);
    auto* const made = ::new (static_cast<void*>(begin)) sm_engine;
    made->limits = in.limits;
    made->camera = model;
    made->extractor.functions = parts.extractor;
    made->store.functions = parts.store;
    const Result<Engine*> result =
        Engine::create({begin + kHeadBytes, bytes_needed(in.limits)}, in.limits, in.configuration, model, cpu_kernels(),
                       parts.options.extractor != nullptr ? &made->extractor : nullptr,
                       {static_cast<const std::byte*>(parts.options.vocabulary), parts.options.vocabulary_bytes},
                       parts.options.store != nullptr ? &made->store : nullptr);
    if (!result.is_ok()) return why_not_created(result.status(), in, parts, problem);
    made->engine = result.value();
    *engine = made;
    return say_ok(problem);
}

void sm_reset(sm_engine* engine) {
    if (engine != nullptr) engine->engine->reset();
}

sm_status sm_start_at(sm_engine* engine, const sm_transform* map_from_camera, sm_problem* problem) {
    if (engine == nullptr || map_from_camera == nullptr) return say(problem, SM_INVALID, "engine or pose is NULL.");
    RigidTransform start;
    std::copy_n(map_from_camera->rotation_xyzw, 4, start.rotation_xyzw);
    std::copy_n(map_from_camera->translation_m, 3, start.translation_m);
    if (engine->engine->start_at(start) == Status::kOk) return say_ok(problem);
    return say(
        problem, SM_INVALID,
        "the pose was refused: its quaternion has no length of 1, it is 1000 m off or more, or there were frames or "
        "a map before it.");
}

sm_status sm_submit(sm_engine* engine, const sm_frame* frame, const sm_motion_hint* hint, sm_problem* problem) {
    sm_frame f;
    sm_motion_hint h;
    if (engine == nullptr || !read_struct(frame, f))
        return say(problem, SM_INVALID, "engine or frame is NULL, or has no size.");
    if (hint != nullptr && !read_struct(hint, h)) return say(problem, SM_INVALID, "the hint has no size.");
    Frame in;
    in.time_ns = f.time_ns;
    in.depth_time_ns = f.depth_time_ns;
    in.format = f.format > 0 && f.format < 256 ? static_cast<PixelFormat>(f.format) : PixelFormat{0};
    in.colour = {f.colour, f.width, f.height, f.colour_stride_bytes};
    in.depth = {f.depth, f.width, f.height, f.depth_stride_bytes % 2 == 0 ? f.depth_stride_bytes / 2 : 0};
    in.depth_units_per_m = f.depth_units_per_m;
    if (f.mask != nullptr) in.mask = {f.mask, f.width, f.height, f.mask_stride_bytes};
    MotionHint motion;
    if (hint != nullptr) {
        std::copy_n(h.last_from_camera.rotation_xyzw, 4, motion.last_from_camera.rotation_xyzw);
        std::copy_n(h.last_from_camera.translation_m, 3, motion.last_from_camera.translation_m);
        motion.sigma_m = h.sigma_m;
        motion.sigma_rad = h.sigma_rad;
    }
    const Status status = engine->engine->submit(in, hint != nullptr ? &motion : nullptr);
    if (status == Status::kOk) return say_ok(problem);
    return say(problem, static_cast<sm_status>(status), "the frame was refused: %s.",
               why_refused(f, engine->camera, hint != nullptr));
}

std::int32_t sm_step(sm_engine* engine, std::uint32_t units) {
    return engine == nullptr ? SM_IDLE : static_cast<std::int32_t>(engine->engine->step(units));
}
std::int32_t sm_step_store(sm_engine* engine, std::uint32_t units) {
    return engine == nullptr ? SM_IDLE : static_cast<std::int32_t>(engine->engine->step_store(units));
}

void sm_set_stage_observer(sm_engine* engine, sm_stage_function function, void* user) {
    if (engine == nullptr) return;
    engine->on_stage = function;
    engine->stage_user = user;
    engine->engine->set_stage_observer(function != nullptr ? StageObserver{on_stage, engine} : StageObserver{});
}

}  // extern "C"
