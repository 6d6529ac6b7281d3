#include "engine/map/map_correction.hpp"

#include <algorithm>

namespace stillmesh {

void move_point(MapPoint& point, const SE3& world_from_world) noexcept {
    store(world_from_world * vector_of(point.world), point.world);
    store(world_from_world * vector_of(point.anchor), point.anchor);
    store(Vector3(world_from_world.rotation * vector_of(point.world_by_readout)), point.world_by_readout);
    store(Vector3(world_from_world.rotation * vector_of(point.anchor_by_readout)), point.anchor_by_readout);
}

void MapCorrection::create(Arena& arena, const Limits& limits) noexcept {
    corrections_ = arena.array<Correction>(limits.keyframes_max);
}

void MapCorrection::begin() noexcept {
    std::fill(corrections_.begin(), corrections_.end(), Correction{});
}

void MapCorrection::correct(Map& map, Handle<Keyframe> handle, const SE3& before, const SE3& now) noexcept {
    STILLMESH_CHECK(map.keyframes().find(handle) != nullptr);
    SE3 correction = now * before.inverse();
    renormalise(correction.rotation);
    move(map, handle.slot(), correction);
}

void MapCorrection::move(Map& map, std::uint32_t slot, const SE3& world_from_world) noexcept {
    SE3& pose = map.keyframes().at(slot).world_from_camera;
    pose = world_from_world * pose;
    renormalise(pose.rotation);
    corrections_[slot] = {world_from_world, true};
    for (int i = 0; i < 3; ++i) map.note_change(pose.translation(i));
}

// What it goes along with: the nearest ancestor that was corrected, unless one that stays comes before it.
const SE3* MapCorrection::inherited(const Map& map, std::uint32_t slot, std::uint64_t first_frame) const noexcept {
    const Pool<Keyframe>& keyframes = map.keyframes();
    while (keyframes.at(slot).frame >= first_frame) {
        const Handle<Keyframe> parent = keyframes.at(slot).parent;
        if (parent.is_null()) return nullptr;
        slot = parent.slot();
        if (of(slot) != nullptr) return of(slot);
    }
    return nullptr;
}

void MapCorrection::follow(Map& map, std::uint64_t first_frame) noexcept {
    const Pool<Keyframe>& keyframes = map.keyframes();
    const std::uint32_t slots = keyframes.slots_count();
    std::uint64_t from_frame = first_frame;
    for (;;) {  // the oldest first
        std::uint32_t next = slots;
        for (std::uint32_t slot = 0; slot < slots; ++slot) {
            if (!keyframes.is_taken(slot) || keyframes.at(slot).frame < from_frame || of(slot) != nullptr) continue;
            if (next == slots || keyframes.at(slot).frame < keyframes.at(next).frame) next = slot;
        }
        if (next == slots) return;
        from_frame = keyframes.at(next).frame + 1;
        const SE3* const correction = inherited(map, next, first_frame);
        if (correction != nullptr) move(map, next, *correction);
    }
}

void SolvedKeyframes::clear() noexcept {
    std::fill(entries_.begin(), entries_.end(), Entry{});
}

void SolvedKeyframes::add(const Map& map, std::uint32_t slot, std::uint32_t number) noexcept {
    entries_[slot] = {map.keyframes().handle_of(slot), map.keyframes().at(slot).world_from_camera, number};
}

const SE3* MapCorrection::of_newest(const Map& map) const noexcept {
    const Handle<Keyframe> newest = map.recent_keyframe(0);
    return newest.is_null() ? nullptr : of(newest.slot());
}

}  // namespace stillmesh
