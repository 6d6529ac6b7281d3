#include "engine/tracking/keyframe_inserter.hpp"

#include <algorithm>

#include "engine/map/eviction.hpp"

namespace stillmesh {

void KeyframeInserter::create(const Parameters& configuration) noexcept {
    parameters_ = configuration.keyframes;
    tracked_urgent_ = parameters_.tracked_urgent_permille * configuration.features.count / 1000;
    weights_ = configuration.weights;
    near_px_ = configuration.matching.radius_wide_px;
    is_region_enabled_ = configuration.region.is_enabled;
    is_mapping_ = configuration.mapping.is_enabled;
}

void KeyframeInserter::reset() noexcept {
    begin_after(0);
    refused_ = 0;
    made_ = 0;
}

void KeyframeInserter::begin_after(std::uint64_t number) noexcept {
    frame_ = number;
    tracked_ = 0;
}

std::uint32_t KeyframeInserter::new_points_possible(const MeasuredFrame& frame, const MapMatcher& matcher) noexcept {
    std::uint32_t count = 0;
    for (std::size_t i = 0; i < frame.size(); ++i) {
        if (matcher.claim(i).is_free() && frame[i].has_depth()) ++count;
    }
    return count;
}

bool KeyframeInserter::wants(std::uint64_t number, std::uint32_t static_count,
                             std::uint32_t new_points_possible) const noexcept {
    const KeyframeParameters& k = parameters_;
    const double share = tracked_ > 0 ? static_cast<double>(static_count) / static_cast<double>(tracked_) : 0.0;
    if (new_points_possible < k.new_points_min) return false;
    if (share < 0.5 * k.tracked_share_max || static_count < tracked_urgent_) return 4 * (number - frame_) >= k.gap_min;
    return share < k.tracked_share_max && number - frame_ >= k.gap_min;
}

// Room for every feature that becomes a point, and no more: what need not go stays. With mapping the room has been made
// ahead, as a rule; where it has not, the local map goes last.
void KeyframeInserter::make_room(std::uint32_t points_wanted, std::uint64_t number, Map& map,
                                 LocalMap& local_map) const noexcept {
    const Pool<MapPoint>& points = map.points();
    for (const bool is_local_spared : {true, false}) {
        const std::size_t free = points.capacity() - points.size();
        if (free >= points_wanted || (is_local_spared && !is_mapping_)) continue;
        static_cast<void>(make_room_for_points(map, static_cast<std::uint32_t>(points_wanted - free), number,
                                               is_local_spared ? local_map.spared() : SparedPoints{}));
    }
    if (!map.keyframes().is_full()) return;
    if (!is_mapping_) {
        evict_oldest(map);
    } else if (!evict_keyframe(map, local_map.keyframes())) {
        STILLMESH_CHECK(evict_keyframe(map, {}));
    }
}

double KeyframeInserter::insert(const Source& source, World& world) noexcept {
    Map& map = world.map;
    const MeasuredFrame& frame = source.frame;
    const MapMatcher& matcher = source.matcher;
    if (!is_mapping_) cull_points(map, source.number);
    make_room(new_points_possible(frame, matcher), source.number, map, world.local_map);
    const Handle<Keyframe> handle = map.add_keyframe();
    Keyframe& keyframe = *map.keyframes().find(handle);
    keyframe.world_from_camera = source.world_from_camera;
    keyframe.pose_by_readout = source.shutter.pose_by_readout();
    keyframe.speed = source.shutter.speed();
    keyframe.readout_s = source.shutter.readout_s();
    keyframe.time_ns = source.time_ns;
    keyframe.frame = source.number;
    keyframe.last_useful_frame = source.number;
    keyframe.drift_m = static_cast<float>(source.drift_m);
    keyframe.travelled = static_cast<float>(source.travelled);
    for (std::size_t i = 0; i < frame.size(); ++i) {
        Observation observation = frame.observation_of(i);
        // What this frame says does not fit is no observation; a moving point is followed.
        if (!matcher.claim(i).is_free()) {
            const std::uint32_t slot = matcher.claim(i).point_slot();
            const Pool<MapPoint>& points = map.points();
            if (points.is_taken(slot) && (source.judge.verdict(i) == Verdict::kStill || points.at(slot).is_suspect)) {
                observation.point = points.handle_of(slot);
            }
        }
        map.add_observation(handle, observation, frame.descriptor(i));
    }
    map.attach(handle);
    std::uint32_t added = 0;
    for (std::size_t i = 0; i < frame.size(); ++i) {
        if (!matcher.claim(i).is_free() || !frame[i].has_depth()) continue;
        const bool is_suspicious = lies_among_moving(source, i);
        add_point(source, i, handle, is_suspicious ? weights_.suspicious : weights_.eligible, map, world.local_map);
        added += is_suspicious ? 0U : 1U;
    }
    frame_ = source.number;
    tracked_ = source.static_count + added / parameters_.new_per_tracked;
    ++made_;
    if (is_mapping_ && !world.keyframe_queue.push(handle)) ++refused_;
    return static_cast<double>(added) / static_cast<double>(std::max(source.static_count + added, 1U));
}

// A new feature beside moving ones at the same depth belongs to the same body more likely than not (method.md 7).
bool KeyframeInserter::lies_among_moving(const Source& source, std::size_t feature) const noexcept {
    if (!is_region_enabled_) return false;
    const MeasuredFrame& frame = source.frame;
    const Keypoint& keypoint = frame.keypoint(feature);
    const double z = frame[feature].z_m;
    std::uint32_t moving = 0;
    std::uint32_t still = 0;
    source.matcher.grid().visit_near(static_cast<double>(keypoint.x), static_cast<double>(keypoint.y), near_px_,
                                     [&](std::uint32_t i) {
                                         const Verdict verdict = source.judge.verdict(i);
                                         if (verdict == Verdict::kNone || !frame[i].has_depth()) return;
                                         const double dz = frame[i].z_m - z;
                                         const double noise = frame[i].var_z + frame[feature].var_z;
                                         const double body = weights_.near_m * weights_.near_m;
                                         if (dz * dz > body + weights_.near_sigmas * weights_.near_sigmas * noise) {
                                             return;
                                         }
                                         ++(verdict == Verdict::kStill ? still : moving);
                                     });
    return moving > still;
}

void KeyframeInserter::add_point(const Source& source, std::size_t feature, Handle<Keyframe> keyframe,
                                 std::uint32_t weight_tenths, Map& map, LocalMap& local_map) const noexcept {
    const Result<Handle<MapPoint>> taken = map.add_point();
    if (!taken.is_ok()) return;  // all others were seen in this very frame; the pool counts the refusal
    MapPoint& point = *map.points().find(taken.value());
    const MeasuredFeature& m = source.frame[feature];
    const Keypoint& keypoint = source.frame.keypoint(feature);
    const Vector3 p = m.point();
    store(source.world_from_camera * p, point.world);
    store(vector_of(point.world), point.anchor);
    store(source.shutter.by_readout(source.world_from_camera, p, keypoint.y), point.world_by_readout);
    store(vector_of(point.world_by_readout), point.anchor_by_readout);
    point.var_z = m.var_z;
    point.var_lateral = m.var_pixel * m.z_m * m.z_m;
    point.anchor_var_z = point.var_z;
    point.anchor_var_lateral = point.var_lateral;
    point.descriptor = source.frame.descriptor(feature);
    point.angle_rad = keypoint.angle_rad;
    point.created_ns = source.time_ns;
    point.anchor_ns = source.time_ns;
    point.last_seen_frame = source.number;
    point.agreed_travelled = static_cast<float>(source.travelled);
    point.distance_m = static_cast<float>(m.z_m);
    point.level = keypoint.level;
    point.weight_tenths = static_cast<std::uint8_t>(weight_tenths);
    point.is_suspect = weight_tenths < weights_.eligible;
    point.seen = 1;
    static_cast<void>(map.link(keyframe, static_cast<std::uint32_t>(feature), taken.value()));
    local_map.add(taken.value().slot());
}

void KeyframeInserter::fill(EngineStatistics& statistics) const noexcept {
    statistics.keyframes_made = made_;
    statistics.keyframes_refused = refused_;
}

}  // namespace stillmesh
