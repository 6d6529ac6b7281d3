// The map: points in the world with their static weights, and keyframes with what they saw, in pools behind handles.
// Covisibility is kept incrementally: each point has a bit per keyframe that observes it, each pair of keyframes the
// number of points they share; every change costs as many steps as the point has observers. Keyframes form a spanning
// tree. Points hold world coordinates and a reference keyframe whose corrections they follow (docs/decisions.md).
// What full pools forget: engine/map/eviction.hpp; how the map moves: map_correction.hpp. Cost: taking and linking
// O(observers).
#pragma once

#include <bit>
#include <cstdint>
#include <span>

#include "engine/base/hash.hpp"
#include "engine/base/pool.hpp"
#include "engine/features/features.hpp"
#include "engine/geometry/se3.hpp"
#include "engine/limits.hpp"
#include "engine/outputs.hpp"
#include "engine/parameters.hpp"

namespace stillmesh {

struct Keyframe;

struct MapPoint {
    // What projecting it into a frame needs, together: some thousands are projected for each frame.
    double world[3] = {};  // m; best estimate. Of a moving point: where it was last seen
    std::uint64_t last_seen_frame = 0;
    Descriptor descriptor;
    float distance_m = 0;             // from the camera that made it
    std::uint8_t level = 0;           // pyramid level of its feature
    std::uint8_t weight_tenths = 10;  // static weight, Algorithm 2
    std::uint8_t empty_views = 0;     // views in a row, or nearly, in which its place was seen to be empty
    bool is_suspect = false;          // has no weight: seen to move, or new beside something that moves

    double anchor[3] = {};              // m; where it was first seen (of a moving point: about a second ago)
    double var_z = 0, var_lateral = 0;  // of `world`, along and across the ray, m^2
    double anchor_var_z = 0, anchor_var_lateral = 0;  // of `anchor`
    float world_by_readout[3] = {};   // m/s; how `world` moves with the rolling shutter's readout (engine/pose)
    float anchor_by_readout[3] = {};  // m/s; likewise
    std::int64_t created_ns = 0;
    std::int64_t anchor_ns = 0;
    float agreed_travelled = 0;   // the odometer's, when a frame last saw it where it is (engine/tracking/odometry.hpp)
    Handle<Keyframe> reference;   // whose corrections it follows; null only while no keyframe observes it
    float angle_rad = 0;          // of its feature, (-pi, pi]
    std::uint16_t seen = 0;       // frames that matched it
    std::uint16_t observers = 0;  // keyframes that observe it
};

// Whether it counts where places are recognised: what moves, or may, does not (method.md 7 and 9). weight_min in 1/10.
[[nodiscard]] constexpr bool is_static(const MapPoint* point, std::uint32_t weight_min) noexcept {
    return point != nullptr && !point->is_suspect && point->weight_tenths >= weight_min;
}

[[nodiscard]] inline Vector3 vector_of(const double (&p)[3]) noexcept {
    return {p[0], p[1], p[2]};
}
[[nodiscard]] inline Vector3 vector_of(const float (&p)[3]) noexcept {
    return {static_cast<double>(p[0]), static_cast<double>(p[1]), static_cast<double>(p[2])};
}
inline void store(const Vector3& v, float (&p)[3]) noexcept {
    for (int i = 0; i < 3; ++i) p[i] = static_cast<float>(v(i));
}
inline void store(const Vector3& v, double (&p)[3]) noexcept {
    p[0] = v.x();
    p[1] = v.y();
    p[2] = v.z();
}

// The point where it would be had the readout been longer by `change_s`.
inline void shift_by_readout(MapPoint& point, double change_s) noexcept {
    for (int i = 0; i < 3; ++i) {
        point.world[i] += static_cast<double>(point.world_by_readout[i]) * change_s;
        point.anchor[i] += static_cast<double>(point.anchor_by_readout[i]) * change_s;
    }
}

struct Keyframe {
    SE3 world_from_camera;
    Vector6 pose_by_readout = Vector6::Zero();  // per second, in the camera: how the pose moves with the readout
    Vector6 speed = Vector6::Zero();            // of the camera, per second, in its own frame
    double readout_s = 0;                       // that its observations were carried to the middle row with
    Handle<Keyframe> parent;                    // in the spanning tree; null: the root
    std::int64_t time_ns = 0;
    std::uint64_t frame = 0;
    std::uint64_t last_useful_frame = 0;  // tracking saw points of it
    std::uint32_t observations = 0;
    std::uint32_t observations_changed = 0;  // times that one came, was moved, or showed another point from then on
    float drift_m = 0;                       // that odometry can have gathered until here, since the map began
    float travelled = 0;                     // the odometer's
};

// A feature of a keyframe.
struct Observation {
    Handle<MapPoint> point;                    // null or stale: none
    float x = 0, y = 0;                        // px, raw
    float normalised_x = 0, normalised_y = 0;  // undistorted (x/z, y/z)
    float z_m = 0;                             // measured
    float var_z = -1;                          // m^2; < 0: no depth
    float angle_rad = 0;                       // (-pi, pi]
    std::uint8_t level = 0;
    std::uint8_t averaged =
        1;  // frames that the undistorted place and the depth are the mean of, at most map.averaged_max
};

class Map {
public:
    static constexpr std::uint32_t kSeenClasses = 8;  // of how often a point was seen

    static constexpr void plan(ArenaPlan& arena, const Limits& limits) noexcept {
        Pool<MapPoint>::plan(arena, limits.map_points_max);
        Pool<Keyframe>::plan(arena, limits.keyframes_max);
        arena.array<Observation>(static_cast<std::size_t>(limits.keyframes_max) * limits.features_max);
        arena.array<Descriptor>(static_cast<std::size_t>(limits.keyframes_max) * limits.features_max);
        arena.array<std::uint64_t>(static_cast<std::size_t>(limits.map_points_max) * words(limits.keyframes_max));
        arena.array<std::uint16_t>(static_cast<std::size_t>(limits.keyframes_max) * limits.keyframes_max);
        arena.array<std::uint64_t>(limits.map_points_max);
        arena.array<std::uint16_t>(std::size_t{kSeenClasses} * limits.keyframes_max);
    }
    void create(Arena& arena, const Limits& limits, const MapParameters& parameters = {}) noexcept;
    // Forgets all of it, what was counted too.
    void reset() noexcept;

    // --- points
    // kFull: nothing changed.
    [[nodiscard]] Result<Handle<MapPoint>> add_point() noexcept;
    // The handle must be alive. Observations of it become stale. Cost: observers^2.
    void release_point(Handle<MapPoint> point) noexcept;
    // `gone` becomes `kept`: its observations move over (or end, where `kept` is observed already), the static weight
    // is that of the longer past. Both alive and different. Returns observations looked at.
    std::uint32_t fuse(Handle<MapPoint> kept, Handle<MapPoint> gone) noexcept;

    // --- keyframes
    // Null: the pool is full, and nothing changed.
    [[nodiscard]] Handle<Keyframe> add_keyframe() noexcept;
    // The keyframe must be alive; its points that no other observes go with it, children get their best covisible
    // surviving keyframe as parent. Cost: its features, and the keyframes.
    void release_keyframe(Handle<Keyframe> keyframe) noexcept;
    // The i-th newest keyframe, 0 is the newest; null when there are not so many.
    [[nodiscard]] Handle<Keyframe> recent_keyframe(std::uint32_t i) const noexcept;
    // Parent of a new keyframe: of the older ones that which shares most with it, the newest of equals.
    void attach(Handle<Keyframe> keyframe) noexcept;
    // Parent of one that comes back from a store, without children: that which shares most with it, the nearest in time
    // of equals. The oldest of all becomes the root: where it lies is where the map began.
    void attach_returned(Handle<Keyframe> keyframe) noexcept;

    // --- observations
    void add_observation(Handle<Keyframe> keyframe, const Observation& observation,
                         const Descriptor& descriptor = {}) noexcept;
    [[nodiscard]] std::span<const Observation> observations(Handle<Keyframe> keyframe) const noexcept;
    [[nodiscard]] std::span<const Descriptor> descriptors(Handle<Keyframe> keyframe) const noexcept;
    // Lets feature `index` of a live keyframe show a live point. False: another feature of it does, or it shows a live
    // point already; nothing changed.
    bool link(Handle<Keyframe> keyframe, std::uint32_t index, Handle<MapPoint> point) noexcept;
    // One more measurement, from near by, of what a feature with depth shows: where it lies in the keyframe's camera,
    // m. The keyframe's measurement is the mean of them, a sliding one beyond map.averaged_max. Nothing happens when
    // the feature does not show `point` any more, or the keyframe is gone.
    void average(Handle<Keyframe> handle, std::uint32_t index, Handle<MapPoint> point,
                 const Vector3& measured) noexcept;
    // The feature shows nothing any more; a point without observers stays until it is released.
    void unlink(Handle<Keyframe> keyframe, std::uint32_t index) noexcept;
    [[nodiscard]] bool is_observed_by(std::uint32_t point_slot, std::uint32_t keyframe_slot) const noexcept {
        return (observers_[point_slot * words_ + keyframe_slot / 64] >> (keyframe_slot % 64) & 1U) != 0;
    }
    template <typename Visit>
    void visit_observers(std::uint32_t point_slot, Visit&& visit) const noexcept {
        for (std::size_t w = 0; w < words_; ++w) {
            for (std::uint64_t bits = observers_[point_slot * words_ + w]; bits != 0; bits &= bits - 1) {
                visit(static_cast<std::uint32_t>(64 * w) + static_cast<std::uint32_t>(std::countr_zero(bits)));
            }
        }
    }
    // Points that two keyframes share.
    [[nodiscard]] std::uint32_t shared(std::uint32_t slot_a, std::uint32_t slot_b) const noexcept {
        return shared_[static_cast<std::size_t>(slot_a) * keyframes_.slots_count() + slot_b];
    }
    // The `best.size()` keyframes that share most with this one, most first (ties: the lower slot); how many there are.
    std::uint32_t best_covisible(std::uint32_t slot, std::span<std::uint32_t> best,
                                 std::uint32_t shared_min = 1) const noexcept;

    // --- the readout that all of it is expressed with (engine/pose/rolling_shutter.hpp)
    [[nodiscard]] double readout_s() const noexcept { return readout_s_; }
    // For a map that was loaded: it is expressed with this one already.
    void begin_with_readout(double readout_s) noexcept { readout_s_ = readout_s; }
    // Points and keyframes where they would be had the readout been this one all along; observations follow when they
    // are asked for. Cost: one pass over both pools.
    void express_with_readout(double readout_s) noexcept;
    // The observations of a live keyframe with the map's readout; what was done.
    bool carry_observations(Handle<Keyframe> handle, std::uint32_t image_height) noexcept;

    // What was changed that is not in the pools: for poses and points written by commits.
    void note_change(std::uint64_t word) noexcept { changes_.add(word); }
    void note_change(double number) noexcept { changes_.add(number); }
    [[nodiscard]] std::uint64_t changes_hash() const noexcept { return changes_.value(); }

    // For a moment: a number per point slot, and kSeenClasses per keyframe slot. Anything may be in them after any
    // call.
    [[nodiscard]] std::span<std::uint64_t> scratch() noexcept { return scratch_; }
    [[nodiscard]] std::span<std::uint16_t> class_counts() noexcept { return class_counts_; }
    [[nodiscard]] Pool<MapPoint>& points() noexcept { return points_; }
    [[nodiscard]] const Pool<MapPoint>& points() const noexcept { return points_; }
    [[nodiscard]] Pool<Keyframe>& keyframes() noexcept { return keyframes_; }
    [[nodiscard]] const Pool<Keyframe>& keyframes() const noexcept { return keyframes_; }
    [[nodiscard]] const MapParameters& parameters() const noexcept { return parameters_; }
    // What takes something from the map counts it there.
    [[nodiscard]] MapStatistics& statistics() noexcept { return statistics_; }
    [[nodiscard]] const MapStatistics& statistics() const noexcept { return statistics_; }
    [[nodiscard]] std::uint64_t keyframes_forgotten() const noexcept {
        return statistics_.keyframes_evicted + statistics_.keyframes_redundant;
    }
    [[nodiscard]] std::uint64_t points_forgotten() const noexcept {
        return statistics_.points_culled + statistics_.points_emptied + statistics_.points_fused +
               statistics_.points_evicted;
    }

private:
    [[nodiscard]] static constexpr std::size_t words(std::uint32_t keyframes) noexcept { return (keyframes + 63) / 64; }
    [[nodiscard]] std::span<Observation> observations_of(std::uint32_t slot) noexcept {
        return observations_.subspan(static_cast<std::size_t>(slot) * features_max_, keyframes_.at(slot).observations);
    }
    void share(std::uint32_t slot_a, std::uint32_t slot_b, std::int32_t change) noexcept;
    void forget_observer(std::uint32_t point_slot, std::uint32_t keyframe_slot) noexcept;
    [[nodiscard]] bool is_below(std::uint32_t slot, std::uint32_t ancestor) const noexcept;

    Pool<MapPoint> points_;
    Pool<Keyframe> keyframes_;
    std::span<Observation> observations_;  // features_max per keyframe slot
    std::span<Descriptor> descriptors_;    // likewise
    std::span<std::uint64_t> observers_;   // words_ per point slot: a bit per keyframe slot
    std::span<std::uint16_t> shared_;      // keyframes_max^2, symmetric, 0 on the diagonal
    std::span<std::uint64_t> scratch_;
    std::span<std::uint16_t> class_counts_;
    MapParameters parameters_;
    std::size_t words_ = 0;
    std::uint32_t features_max_ = 0;
    double readout_s_ = 0;
    MapStatistics statistics_;
    StateHash changes_;
};

}  // namespace stillmesh
