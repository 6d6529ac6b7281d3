// How the map moves, the one way: some keyframes are given new poses; those that follow get the correction of their
// nearest corrected ancestor in the spanning tree; points go with their reference keyframe, with their anchors and with
// what the readout does to them; the camera goes with the newest keyframe. Local adjustment, pose graph and global
// adjustment differ in what they give new poses to. Used within one step: begin(), correct() each, follow(),
// move_points(). A parent may be newer than its child: after a return from the store, or when the parent before was
// forgotten. Limits: keyframes_max corrections. Cost: one pass over the points; followers times keyframes.
#pragma once

#include <cstdint>
#include <span>

#include "engine/base/arena.hpp"
#include "engine/geometry/se3.hpp"
#include "engine/limits.hpp"
#include "engine/map/map.hpp"

namespace stillmesh {

// All of a point that lies in the world: where it is, where it was first seen, and how both move with the readout.
void move_point(MapPoint& point, const SE3& world_from_world) noexcept;

class MapCorrection {
public:
    static constexpr void plan(ArenaPlan& arena, const Limits& limits) noexcept {
        arena.array<Correction>(limits.keyframes_max);
    }
    void create(Arena& arena, const Limits& limits) noexcept;

    // Nothing is corrected.
    void begin() noexcept;
    // A live keyframe that lay at `before` when the problem was made should have lain at `now`: it moves by as much
    // from where it lies, so that what was learnt of the readout meanwhile stays.
    void correct(Map& map, Handle<Keyframe> handle, const SE3& before, const SE3& now) noexcept;
    // The other keyframes go along with their nearest corrected ancestor. Those of frames before `first_frame` stay,
    // and what hangs below them.
    void follow(Map& map, std::uint64_t first_frame) noexcept;
    // Every point goes with its reference keyframe; one without, with the newest.
    void move_points(Map& map) const noexcept {
        move_points(map, [](std::uint32_t, const MapPoint&, Vector3&) { return false; });
    }
    // `place(slot, point, world)` may say better where a point is: it is asked before the point moves, fills `world`
    // and returns true.
    template <typename Place>
    void move_points(Map& map, Place&& place) const noexcept {
        const SE3* const of_camera = of_newest(map);
        Pool<MapPoint>& points = map.points();
        for (std::uint32_t slot = 0; slot < points.slots_count(); ++slot) {
            if (!points.is_taken(slot)) continue;
            MapPoint& point = points.at(slot);
            Vector3 world;
            const bool is_placed = place(slot, point, world);
            const SE3* const correction = point.reference.is_null() ? of_camera : of(point.reference.slot());
            if (correction != nullptr) move_point(point, *correction);
            if (is_placed) store(world, point.world);
        }
    }

    // By keyframe slot; nullptr: it stays where it was.
    [[nodiscard]] const SE3* of(std::uint32_t slot) const noexcept {
        return corrections_[slot].is_any ? &corrections_[slot].world_from_world : nullptr;
    }
    // Of the newest keyframe, hence of the camera.
    [[nodiscard]] const SE3* of_newest(const Map& map) const noexcept;

private:
    struct Correction {
        SE3 world_from_world;  // new from old
        bool is_any = false;
    };
    void move(Map& map, std::uint32_t slot, const SE3& world_from_world) noexcept;
    [[nodiscard]] const SE3* inherited(const Map& map, std::uint32_t slot, std::uint64_t first_frame) const noexcept;

    std::span<Correction> corrections_;  // by keyframe slot
};

// The keyframes that a solver was given: their numbers in it, and where they lay then. Those that leave the map
// meanwhile are left out.
class SolvedKeyframes {
public:
    static constexpr void plan(ArenaPlan& arena, std::uint32_t keyframes_max) noexcept {
        arena.array<Entry>(keyframes_max);
    }
    void create(Arena& arena, std::uint32_t keyframes_max) noexcept { entries_ = arena.array<Entry>(keyframes_max); }
    void clear() noexcept;
    void add(const Map& map, std::uint32_t slot, std::uint32_t number) noexcept;

    [[nodiscard]] bool has(std::uint32_t slot) const noexcept { return !entries_[slot].handle.is_null(); }
    [[nodiscard]] std::uint32_t number(std::uint32_t slot) const noexcept { return entries_[slot].number; }
    [[nodiscard]] Handle<Keyframe> handle(std::uint32_t slot) const noexcept { return entries_[slot].handle; }

    // They go where the solver says (pose(number)), and all other keyframes with them.
    template <typename Solver>
    void move(Map& map, MapCorrection& correction, const Solver& solver) const noexcept {
        correction.begin();
        for (std::uint32_t slot = 0; slot < entries_.size(); ++slot) {
            if (map.keyframes().find(handle(slot)) == nullptr) continue;
            correction.correct(map, handle(slot), entries_[slot].before, solver.pose(number(slot)));
        }
        correction.follow(map, 0);
    }

private:
    struct Entry {
        Handle<Keyframe> handle;  // null: not given
        SE3 before;
        std::uint32_t number = 0;
    };
    std::span<Entry> entries_;  // by slot
};

}  // namespace stillmesh
