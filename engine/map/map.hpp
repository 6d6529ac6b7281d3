// The map: points in the world with their static weights, and keyframes with what they saw, in pools behind handles.
// Full pools: the points least recently seen and the oldest keyframe are forgotten and counted. Cost: taking is O(1);
// forgetting points is one pass over the pool, done for many at a time.
#pragma once

#include <cstdint>
#include <span>

#include "engine/base/pool.hpp"
#include "engine/features/features.hpp"
#include "engine/geometry/se3.hpp"
#include "engine/limits.hpp"

namespace stillmesh {

struct MapPoint {
    double world[3] = {};               // m; best estimate. Of a moving point: where it was last seen
    double anchor[3] = {};              // m; where it was first seen (of a moving point: about a second ago)
    double var_z = 0, var_lateral = 0;  // of `world`, along and across the ray, m^2
    double anchor_var_z = 0, anchor_var_lateral = 0;  // of `anchor`
    Descriptor descriptor;
    std::int64_t created_ns = 0;
    std::int64_t anchor_ns = 0;
    std::uint64_t last_seen_frame = 0;
    float distance_m = 0;             // from the camera that made it
    float angle_rad = 0;              // of its feature, (-pi, pi]
    std::uint16_t seen = 0;           // frames that matched it
    std::uint8_t level = 0;           // pyramid level of its feature
    std::uint8_t weight_tenths = 10;  // static weight, Algorithm 2
    bool is_suspect = false;          // has no vote: seen to move, or new beside something that moves
};

[[nodiscard]] inline Vector3 vector_of(const double (&p)[3]) noexcept {
    return {p[0], p[1], p[2]};
}

struct Keyframe {
    SE3 world_from_camera;
    std::int64_t time_ns = 0;
    std::uint64_t frame = 0;
    std::uint32_t observations = 0;
};

struct Observation {
    Handle<MapPoint> point;
    float x = 0, y = 0;  // px
};

class Map {
public:
    static constexpr std::uint64_t kCullAfter_frames = 30;
    static constexpr std::uint16_t kSeenMin = 3;

    static constexpr void plan(ArenaPlan& arena, const Limits& limits) noexcept {
        Pool<MapPoint>::plan(arena, limits.map_points_max);
        Pool<Keyframe>::plan(arena, limits.keyframes_max);
        arena.array<Observation>(static_cast<std::size_t>(limits.keyframes_max) * limits.features_max);
        arena.array<std::uint64_t>(limits.map_points_max);
    }
    void create(Arena& arena, const Limits& limits) noexcept;
    // Forgets all of it, what was counted too.
    void reset() noexcept;

    // Forgets the `count` points least recently seen (ties: the lower slot). Those seen in `frame` stay.
    void make_room_for_points(std::uint32_t count, std::uint64_t frame) noexcept;
    // Forgets what is not worth keeping: unseen for a second, and moving or hardly ever seen before.
    void cull_points(std::uint64_t frame) noexcept;
    // The new keyframe is the newest; when the pool is full the oldest goes first.
    [[nodiscard]] Handle<Keyframe> add_keyframe() noexcept;
    void add_observation(Handle<Keyframe> keyframe, const Observation& observation) noexcept;
    [[nodiscard]] std::span<const Observation> observations(Handle<Keyframe> keyframe) const noexcept;
    // The i-th newest keyframe, 0 is the newest; null when there are not so many.
    [[nodiscard]] Handle<Keyframe> recent_keyframe(std::uint32_t i) const noexcept;

    [[nodiscard]] Pool<MapPoint>& points() noexcept { return points_; }
    [[nodiscard]] const Pool<MapPoint>& points() const noexcept { return points_; }
    [[nodiscard]] Pool<Keyframe>& keyframes() noexcept { return keyframes_; }
    [[nodiscard]] const Pool<Keyframe>& keyframes() const noexcept { return keyframes_; }
    [[nodiscard]] std::uint64_t keyframes_forgotten() const noexcept { return keyframes_forgotten_; }
    [[nodiscard]] std::uint64_t points_forgotten() const noexcept { return points_forgotten_; }

private:
    Pool<MapPoint> points_;
    Pool<Keyframe> keyframes_;
    std::span<Observation> observations_;  // features_max per keyframe slot
    std::span<std::uint64_t> by_age_;      // scratch: (last seen frame, slot) packed
    std::uint32_t features_max_ = 0;
    std::uint64_t keyframes_forgotten_ = 0;
    std::uint64_t points_forgotten_ = 0;
};

}  // namespace stillmesh
