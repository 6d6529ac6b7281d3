#include "engine/map/map_correction.hpp"

#include <algorithm>

namespace stillmesh {

SE3 correction_between(const SE3& now, const SE3& before) noexcept {
    SE3 out = now * before.inverse();
    renormalise(out.rotation);
    return out;
}

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

void MapCorrection::correct(Map& map, Handle<Keyframe> handle, const SE3& world_from_camera,
                            const SE3& world_from_world) noexcept {
    Keyframe* const keyframe = map.keyframes().find(handle);
    STILLMESH_CHECK(keyframe != nullptr);
    keyframe->world_from_camera = world_from_camera;
    corrections_[handle.slot()].world_from_world = world_from_world;
    corrections_[handle.slot()].is_any = true;
}

void MapCorrection::follow(Map& map, std::uint64_t first_frame) noexcept {
    const Pool<Keyframe>& keyframes = map.keyframes();
    const std::uint32_t slots = keyframes.slots_count();
    // Oldest first.
    for (;;) {
        std::uint32_t next = slots;
        for (std::uint32_t slot = 0; slot < slots; ++slot) {
            if (!keyframes.is_taken(slot) || corrections_[slot].is_any || corrections_[slot].is_looked_at) continue;
            if (keyframes.at(slot).frame < first_frame) continue;
            if (next == slots || keyframes.at(slot).frame < keyframes.at(next).frame) next = slot;
        }
        if (next == slots) return;
        corrections_[next].is_looked_at = true;
        const Handle<Keyframe> parent = keyframes.at(next).parent;
        const SE3* const correction = parent.is_null() ? nullptr : of(parent.slot());
        if (correction == nullptr) continue;
        SE3 pose = *correction * keyframes.at(next).world_from_camera;
        renormalise(pose.rotation);
        correct(map, keyframes.handle_of(next), pose, *correction);
        for (int i = 0; i < 3; ++i) map.note_change(pose.translation(i));
    }
}

const SE3* MapCorrection::of_newest(const Map& map) const noexcept {
    const Handle<Keyframe> newest = map.recent_keyframe(0);
    return newest.is_null() ? nullptr : of(newest.slot());
}

}  // namespace stillmesh
