// The part of the map that a camera may see: the keyframes that share points with the last frame, their best covisible
// neighbours and the neighbours of those, and keyframes with a near viewpoint; and the map's points within the camera's
// view, whichever keyframe observes them: keyframes that share most are the newest, and without the points that only
// old ones observe the map would drift. Where there are too many, those of the local keyframes come first. Tracking
// projects these alone, so that its time does not grow with the map. Limits: kKeyframesMax keyframes (at most half of
// the pool: something must remain that may be evicted) and local_points_max points. Cost of build(): one look at every
// keyframe's pose and at every point, and at the features of the local keyframes where there are too many points; of
// count(): matches times observers.
#pragma once

#include <cstdint>
#include <span>

#include "engine/base/fixed_vector.hpp"
#include "engine/map/eviction.hpp"
#include "engine/map/map.hpp"

namespace stillmesh {

class LocalMap {
public:
    static constexpr std::uint32_t kKeyframesMax = 24;

    static constexpr void plan(ArenaPlan& arena, const Limits& limits) noexcept {
        FixedVector<std::uint32_t>::plan(arena, points_max(limits));
        arena.array<std::uint8_t>(limits.map_points_max);
        arena.array<std::uint8_t>(limits.keyframes_max);
        arena.array<std::uint16_t>(limits.keyframes_max);
        arena.array<std::uint16_t>(limits.keyframes_max);
    }
    // `view_cosine`: of the angle between the camera's axis and its farthest corner.
    void create(Arena& arena, const Limits& limits, const LocalMapParameters& parameters = {},
                double view_cosine = 0.7) noexcept;
    void reset() noexcept;

    // How many of the matched points (by slot) each keyframe observes. Begin, add each, then build or ask.
    void begin_counting() noexcept;
    void count(const Map& map, std::uint32_t point_slot) noexcept;
    // What was counted, put aside and taken back: for a place that is tried.
    void keep_counts() noexcept;
    void restore_counts() noexcept;
    // The keyframe that observes most of them; null: none observes any.
    [[nodiscard]] Handle<Keyframe> reference(const Map& map) const noexcept;
    // Keyframes that observe a part (useful_factor) of what the reference does are useful.
    void note_useful(Map& map, std::uint64_t frame) const noexcept;

    // Whether the list is out of date: the map's newest keyframe or the reference changed, or the camera moved on.
    [[nodiscard]] bool is_stale(const Map& map, const SE3& world_from_camera) const noexcept;
    void build(const Map& map, const SE3& world_from_camera) noexcept;
    // The map moved: what was listed is out of date.
    void invalidate() noexcept { is_built_ = false; }
    // A new point; a slot that is listed already is not listed twice.
    void add(std::uint32_t point_slot) noexcept;

    // Slots, some of which may be free by now, or have another tenant: they are skipped, or as welcome.
    [[nodiscard]] std::span<const std::uint32_t> points() const noexcept { return points_.span(); }
    // By keyframe slot: 1 in the local map.
    [[nodiscard]] std::span<const std::uint8_t> keyframes() const noexcept { return is_local_; }
    [[nodiscard]] SparedPoints spared() const noexcept { return {listed_, round_}; }

private:
    [[nodiscard]] static constexpr std::uint32_t points_max(const Limits& limits) noexcept {
        return limits.local_points_max < limits.map_points_max ? limits.local_points_max : limits.map_points_max;
    }
    bool choose(std::uint32_t keyframe_slot) noexcept;
    [[nodiscard]] bool may_be_seen(const MapPoint& point) const noexcept;
    void choose_keyframes(const Map& map, const SE3& world_from_camera) noexcept;
    void list_points(const Map& map) noexcept;

    LocalMapParameters parameters_;
    FixedVector<std::uint32_t> points_;
    std::span<std::uint8_t> listed_;  // by point slot: the round that listed it
    std::span<std::uint8_t> is_local_;
    std::span<std::uint16_t> counts_;
    std::span<std::uint16_t> kept_counts_;
    std::uint32_t chosen_[kKeyframesMax] = {};
    std::uint32_t chosen_count_ = 0;
    std::uint32_t chosen_max_ = 0;
    std::uint8_t round_ = 0;
    double cone_cosine_ = 0;
    SE3 built_at_;
    Handle<Keyframe> reference_, newest_;
    bool is_built_ = false;
};

}  // namespace stillmesh
