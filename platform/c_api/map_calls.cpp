// Maps on disk and in memory.
#include <new>
#include <span>
#include <string>

#include "engine/map_merge.hpp"
#include "platform/c_api/engine_memory.hpp"
#include "platform/linux/atomic_file.hpp"
#include "platform/linux/memory_block.hpp"
#include "platform/record/map_saver.hpp"

namespace stillmesh::c_api {
namespace {

static_assert(sizeof(MapFileWriter) <= sizeof(sm_map_writer::inside) && alignof(MapFileWriter) <= 8);

[[nodiscard]] std::uint8_t extractor_of(const sm_engine& engine) noexcept {
    return static_cast<std::uint8_t>(engine.extractor.functions.number);
}
[[nodiscard]] bool use_of(std::int32_t use, MapUse& out) noexcept {
    out = use == SM_MAP_LOCALISE ? MapUse::kLocalise : MapUse::kContinue;
    return use == SM_MAP_LOCALISE || use == SM_MAP_CONTINUE;
}
[[nodiscard]] sm_status say_fault(Status status, const MapFileProblem& fault, sm_problem* problem) {
    return say(problem, static_cast<sm_status>(status), "%s", map_sentence("the map", fault).c_str());
}

// `name`: of the second map, for sentences.
[[nodiscard]] sm_status join_map(sm_engine& engine, std::span<const std::byte> second, const std::string& name,
                                 sm_map_merge* out, sm_problem* problem) {
    if (out != nullptr && out->size < 2 * sizeof(std::uint32_t)) return say(problem, SM_INVALID, "merge has no size.");
    MapFileProblem fault;
    MapMerge merge;
    const Status status = merge_map(*engine.engine, second, fault, merge, extractor_of(engine));
    const sm_map_merge to{0,
                          merge.is_alike ? 1U : 0U,
                          merge.keyframes,
                          merge.found,
                          merge.agreeing,
                          merge.points_fused,
                          merge.elsewhere_share,
                          transform_of(merge.map_from_second)};
    if (out != nullptr) static_cast<void>(write_struct(to, out));
    if (status == Status::kOk) return say_ok(problem);
    const std::string why = status == Status::kNotFound ? merge_sentence(name, "the map", merge)
                            : status == Status::kUnavailable
                                ? "a map is joined to one that was just loaded, by an engine with a vocabulary."
                                : map_sentence(name, fault);
    return say(problem, static_cast<sm_status>(status), "%s", why.c_str());
}

}  // namespace
}  // namespace stillmesh::c_api

using namespace stillmesh;         // NOLINT: the calls stand outside of every namespace
using namespace stillmesh::c_api;  // NOLINT

extern "C" {

sm_status sm_save_map(sm_engine* engine, const char* file, sm_problem* problem) {
    if (engine == nullptr || file == nullptr) return say(problem, SM_INVALID, "engine or file is NULL.");
    return guarded(problem, [&] {
        MapSaver saver;
        std::string message;
        if (!saver.open(file, engine->limits, extractor_of(*engine), 0, message)) {
            return say(problem, SM_UNAVAILABLE, "%s", message.c_str());
        }
        message = saver.finish(*engine->engine);
        return message.empty() ? say_ok(problem) : say(problem, SM_UNAVAILABLE, "%s", message.c_str());
    });
}

sm_status sm_load_map_file(sm_engine* engine, const char* file, std::int32_t use, sm_problem* problem) {
    MapUse how{};
    if (engine == nullptr || file == nullptr || !use_of(use, how)) {
        return say(problem, SM_INVALID, "engine or file is NULL, or use is none.");
    }
    return guarded(problem, [&] {
        MapFileInfo info;
        std::string message;
        const Status status = load_map_file(file, *engine->engine, how, extractor_of(*engine), info, message);
        return say(problem, static_cast<sm_status>(status), "%s", message.c_str());
    });
}

sm_status sm_load_map(sm_engine* engine, const void* bytes, std::size_t size, std::int32_t use, sm_problem* problem) {
    MapUse how{};
    if (engine == nullptr || bytes == nullptr || !use_of(use, how)) {
        return say(problem, SM_INVALID, "engine or bytes are NULL, or use is none.");
    }
    MapFileProblem fault;
    const Status status =
        engine->engine->load_map({static_cast<const std::byte*>(bytes), size}, how, fault, extractor_of(*engine));
    if (status == Status::kOk) return say_ok(problem);
    return guarded(problem, [&] { return say_fault(status, fault, problem); });
}

sm_status sm_set_map_use(sm_engine* engine, std::int32_t use, sm_problem* problem) {
    MapUse how{};
    if (engine == nullptr || !use_of(use, how)) return say(problem, SM_INVALID, "engine is NULL, or use is none.");
    engine->engine->set_map_use(how);
    return say_ok(problem);
}

sm_status sm_merge_map(sm_engine* engine, const void* bytes, std::size_t size, sm_map_merge* merge,
                       sm_problem* problem) {
    if (engine == nullptr || bytes == nullptr) return say(problem, SM_INVALID, "engine or bytes are NULL.");
    return guarded(problem, [&] {
        return join_map(*engine, {static_cast<const std::byte*>(bytes), size}, "the second map", merge, problem);
    });
}
sm_status sm_merge_map_file(sm_engine* engine, const char* file, sm_map_merge* merge, sm_problem* problem) {
    if (engine == nullptr || file == nullptr) return say(problem, SM_INVALID, "engine or file is NULL.");
    return guarded(problem, [&] {
        MemoryBlock block;
        std::span<const std::byte> bytes;
        std::string message;
        if (!read_whole_file(file, kMapFileBytesMax, block, bytes, message))
            return say(problem, SM_UNAVAILABLE, "%s", message.c_str());
        return join_map(*engine, bytes, file, merge, problem);
    });
}
sm_status sm_fit_map(sm_engine* engine, const sm_settings* settings, sm_problem* problem) {
    Settings in;
    if (engine == nullptr || !read_settings(settings, in))
        return say(problem, SM_INVALID, "engine is NULL, or settings are none: sm_settings_init.");
    fit_map(*engine->engine, in.limits);
    return say_ok(problem);
}

sm_status sm_read_map_header(const void* bytes, std::size_t size, sm_map_info* info, sm_problem* problem) {
    if (bytes == nullptr) return say(problem, SM_INVALID, "bytes are NULL.");
    MapFileInfo in;
    MapFileProblem fault;
    const Status status = read_map_header({static_cast<const std::byte*>(bytes), size}, in, fault);
    if (status != Status::kOk) return guarded(problem, [&] { return say_fault(status, fault, problem); });
    static_cast<void>(say_ok(problem));
    return write_struct({0, in.extractor, in.size_bytes, in.keyframes, in.points, in.features, in.features_of_keyframe,
                         in.pyramid_levels, in.lens_crc, in.scale_factor, in.time_ns, in.frames, in.hash,
                         in.depth_images, in.depth_columns, in.depth_rows},
                        info);
}

std::size_t sm_map_copy_bytes(const sm_settings* settings) {
    Settings in;
    return read_settings(settings, in) ? map_copy_bytes(in.limits) : 0;
}

sm_status sm_begin_map_copy(sm_engine* engine, void* workspace, std::size_t bytes, sm_problem* problem) {
    if (engine == nullptr || workspace == nullptr) return say(problem, SM_INVALID, "engine or workspace is NULL.");
    if (reinterpret_cast<std::uintptr_t>(workspace) % kArenaAlignment != 0) {
        return say(problem, SM_INVALID, "the workspace is not aligned to %zu bytes.", kArenaAlignment);
    }
    const Status status =
        engine->engine->begin_map_copy({static_cast<std::byte*>(workspace), bytes}, extractor_of(*engine));
    if (status == Status::kOk) return say_ok(problem);
    return say(problem, static_cast<sm_status>(status), "%s",
               status == Status::kFull ? "the workspace is too small: sm_map_copy_bytes." : "there is no map yet.");
}
std::int32_t sm_step_map_copy(sm_engine* engine, std::uint32_t units) {
    return engine == nullptr ? SM_IDLE : static_cast<std::int32_t>(engine->engine->step_map_copy(units));
}

sm_status sm_map_writer_init(sm_map_writer* writer, const void* workspace, std::size_t bytes) {
    if (writer == nullptr || writer->size < sizeof(sm_map_writer) || workspace == nullptr) return SM_INVALID;
    ::new (static_cast<void*>(writer->inside)) MapFileWriter({static_cast<const std::byte*>(workspace), bytes});
    writer->is_set = kSettingsMark;
    return SM_OK;
}
std::size_t sm_map_writer_next(sm_map_writer* writer, void* out, std::size_t bytes) {
    if (writer == nullptr || writer->is_set != kSettingsMark || out == nullptr || bytes < kMapPieceBytesMin) return 0;
    return reinterpret_cast<MapFileWriter*>(writer->inside)->next({static_cast<std::byte*>(out), bytes});
}

}  // extern "C"
