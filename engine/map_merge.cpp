#include "engine/map_merge.hpp"

#include "engine/engine_state.hpp"
#include "engine/map/eviction.hpp"
#include "engine/recognition/map_overlap.hpp"
#include "engine/record/map_checks.hpp"
#include "engine/record/map_load.hpp"

namespace stillmesh {
namespace {

constexpr std::int64_t kPause_ns = 1'000'000'000;  // between both on the map's clock, as between two sessions

// Whether both together are within limits and clocks; the file is right by itself.
Status check_both(const EngineState& state, const MapFileInfo& second, MapFileProblem& problem) noexcept {
    const World& world = state.world;
    const auto is_within = [&problem](const char* key, std::size_t value, std::uint32_t limit) {
        if (value > limit)
            problem = {MapFault::kTooManyFor, key, static_cast<double>(value), static_cast<double>(limit)};
        return value <= limit;
    };
    const Map& map = world.map;
    if (!is_within("limits.keyframes_max", map.keyframes().size() + second.keyframes, world.limits.keyframes_max) ||
        !is_within("limits.map_points_max", map.points().size() + second.points, world.limits.map_points_max)) {
        return Status::kFull;
    }
    if (second.time_ns <= map_checks::kTimeMax_ns - kPause_ns - world.clock.time_ns &&
        second.frames <= map_checks::kFramesMax - world.clock.frame) {
        return Status::kOk;
    }
    problem.fault = MapFault::kImpossible;  // one by one: gcc for arm64 keeps whole constants with addresses in .data
    problem.part = "the time of both maps together";
    return Status::kCorrupt;
}

// What lies in the second map's coordinates, in the first one's.
void move_second(Map& map, std::uint32_t first_keyframe, std::uint32_t first_point,
                 const SE3& map_from_second) noexcept {
    for (std::uint32_t slot = first_keyframe; slot < map.keyframes().slots_count(); ++slot) {
        if (!map.keyframes().is_taken(slot)) continue;
        SE3& pose = map.keyframes().at(slot).world_from_camera;
        pose = map_from_second * pose;
        renormalise(pose.rotation);
        for (int i = 0; i < 3; ++i) map.note_change(pose.translation(i));
    }
    for (std::uint32_t slot = first_point; slot < map.points().slots_count(); ++slot) {
        if (map.points().is_taken(slot)) move_point(map.points().at(slot), map_from_second);
    }
}

// The second tree hangs below `place` from `keyframe` on: from there up to its root every parent becomes a child.
void hang_below(Map& map, Handle<Keyframe> keyframe, Handle<Keyframe> place) noexcept {
    Handle<Keyframe> parent = place;
    for (Handle<Keyframe> at = keyframe; !at.is_null();) {
        Keyframe& here = *map.keyframes().find(at);
        const Handle<Keyframe> next = here.parent;
        here.parent = parent;
        parent = at;
        at = next;
    }
}

// Points that both maps have, as far as keyframes of the second show them: those of the first stay.
std::uint32_t fuse_points(EngineState& state, MapOverlap& overlap, std::uint32_t first_keyframe) noexcept {
    Map& map = state.world.map;
    const std::uint32_t eligible = state.world.parameters.weights.eligible;
    std::uint32_t fused = 0;
    for (std::uint32_t slot = first_keyframe; slot < map.keyframes().slots_count(); ++slot) {
        if (!map.keyframes().is_taken(slot) || !overlap.recognise(slot)) continue;
        const Handle<Keyframe> keyframe = map.keyframes().handle_of(slot);
        if (!MapOverlap::is_same(state.relocalisation.world_from_camera(),
                                 map.keyframes().at(slot).world_from_camera)) {
            continue;
        }
        for (const PlaceMatch& match : state.relocalisation.matches()) {
            const Handle<MapPoint> own = map.observations(keyframe)[match.feature].point;
            if (!is_static(map.points().find(match.point), eligible) || own == match.point) continue;
            if (!is_static(map.points().find(own), eligible)) continue;
            static_cast<void>(map.fuse(match.point, own));
            ++fused;
        }
    }
    return fused;
}

}  // namespace

Status merge_map(Engine& engine, std::span<const std::byte> second, MapFileProblem& problem, MapMerge& merge,
                 std::uint8_t extractor) noexcept {
    auto& state = static_cast<EngineState&>(engine);
    World& world = state.world;
    Map& map = world.map;
    merge = MapMerge{};
    problem = MapFileProblem{};
    if (state.has_time || map.keyframes().size() == 0 || !state.relocalisation.is_on()) return Status::kUnavailable;
    MapOrigin origin = state.map_origin;
    origin.extractor = extractor;
    MapFileInfo info;
    STILLMESH_TRY(check_map_file(second, world.limits, origin, map, info, problem));
    STILLMESH_TRY(check_both(state, info, problem));
    const auto first_keyframe = static_cast<std::uint32_t>(map.keyframes().size());
    const auto first_point = static_cast<std::uint32_t>(map.points().size());
    const MapEnd end{world.clock.frame, world.clock.time_ns + kPause_ns};
    append_map(second, info, end, map);
    merge.keyframes = info.keyframes;
    MapOverlap overlap(map, world.parameters, state.places, state.relocalisation, first_keyframe);
    const Overlap found = overlap.find();
    merge.found = found.found;
    merge.agreeing = found.agreeing;
    merge.elsewhere_share =
        found.likeness > 0 ? static_cast<double>(found.elsewhere) / static_cast<double>(found.likeness) : 0;
    merge.is_alike = !found.is_found && found.agreeing >= MapOverlap::kAgreeingMin;
    merge.map_from_second = transform_of(found.map_from_other);
    if (!found.is_found) {
        engine.reset();
        return Status::kNotFound;
    }
    move_second(map, first_keyframe, first_point, found.map_from_other);
    append_depth_images(second, info, end, map, world.depth_images);
    hang_below(map, found.keyframe, found.place);
    merge.points_fused = fuse_points(state, overlap, first_keyframe);
    state.places.reset();
    state.relocalisation.reset();
    state.tracking.begin_in_map(end.frames + info.frames, end.time_ns + info.time_ns, false);
    ++world.loops_closed;  // all of it is to be adjusted
    return Status::kOk;
}

void fit_map(Engine& engine, const Limits& limits) noexcept {
    World& world = static_cast<EngineState&>(engine).world;
    Map& map = world.map;
    while (map.keyframes().size() > limits.keyframes_max && evict_keyframe(map, {})) {
    }
    world.depth_images.thin(limits.depth_images_max, map.keyframes());
    if (map.points().size() <= limits.map_points_max) return;
    // All may go: none was seen in a frame to come.
    const auto above = static_cast<std::uint32_t>(map.points().size() - limits.map_points_max);
    static_cast<void>(make_room_for_points(map, above, world.clock.frame + 1, {}));
}

}  // namespace stillmesh
