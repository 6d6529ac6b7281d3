#include "engine/tracking/keyframe_inserter.hpp"

#include <algorithm>

#include "engine/base/time.hpp"
#include "engine/map/eviction.hpp"

namespace stillmesh {
namespace {

// Furniture that was moved has left its place in a grid after some looks.
constexpr double kLookEvery_s = 1.0;
// Before, nothing has moved for long enough to be known for it: people would be in the images.
constexpr double kLooksAfter_s = 1.0;

}  // namespace

void KeyframeInserter::begin_after(std::uint64_t number) noexcept {
    frame_ = number;
    tracked_ = 0;
    looked_ns_ = 0;
    begun_ns_ = -1;
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
    const KeyframeParameters& k = parameters_->keyframes;
    const double share = tracked_ > 0 ? static_cast<double>(static_count) / static_cast<double>(tracked_) : 0.0;
    if (new_points_possible < k.new_points_min) return false;
    const std::uint32_t urgent = k.tracked_urgent_permille * parameters_->features.count / 1000;
    if (share < 0.5 * k.tracked_share_max || static_count < urgent) return 4 * (number - frame_) >= k.gap_min;
    return share < k.tracked_share_max && number - frame_ >= k.gap_min;
}

// Room for every feature that becomes a point, and no more: what need not go stays. With mapping the room has been made
// ahead, as a rule; where it has not, the local map goes last.
void KeyframeInserter::make_room(std::uint32_t points_wanted, std::uint64_t number, World& world) const noexcept {
    const bool is_mapping = parameters_->mapping.is_enabled;
    Map& map = world.map;
    const Pool<MapPoint>& points = map.points();
    for (const bool is_local_spared : {true, false}) {
        const std::size_t free = points.capacity() - points.size();
        if (free >= points_wanted || (is_local_spared && !is_mapping)) continue;
        static_cast<void>(make_room_for_points(map, static_cast<std::uint32_t>(points_wanted - free), number,
                                               is_local_spared ? world.local_map.spared() : SparedPoints{}));
    }
    if (!map.keyframes().is_full()) return;
    if (!is_mapping) {
        evict_oldest(map);
    } else if (!evict_keyframe(map, world.local_map.keyframes())) {
        STILLMESH_CHECK(evict_keyframe(map, {}));
    }
}

double KeyframeInserter::insert(const Source& source, World& world) noexcept {
    Map& map = world.map;
    const MeasuredFrame& frame = source.posed.frame;
    const MapMatcher& matcher = source.matcher;
    const bool is_mapping = parameters_->mapping.is_enabled;
    if (!is_mapping) cull_points(map, source.posed.number);
    make_room(new_points_possible(frame, matcher), source.posed.number, world);
    if (is_mapping) free_space_.ask(source.posed, matcher, world);
    const Handle<Keyframe> handle = map.add_keyframe();
    Keyframe& keyframe = *map.keyframes().find(handle);
    keyframe.world_from_camera = source.posed.world_from_camera;
    keyframe.pose_by_readout = source.posed.shutter.pose_by_readout();
    keyframe.speed = source.posed.shutter.speed();
    keyframe.readout_s = source.posed.shutter.readout_s();
    keyframe.time_ns = source.posed.time_ns;
    keyframe.frame = source.posed.number;
    keyframe.last_useful_frame = source.posed.number;
    keyframe.drift_m = static_cast<float>(source.drift_m);
    keyframe.travelled = static_cast<float>(source.posed.travelled);
    for (std::size_t i = 0; i < frame.size(); ++i) {
        Observation observation = frame.observation_of(i);
        // What this frame says does not fit is no observation; a moving point is followed.
        if (!matcher.claim(i).is_free()) {
            const std::uint32_t slot = matcher.claim(i).point_slot();
            const Pool<MapPoint>& points = map.points();
            if (points.is_taken(slot) && (source.judge.verdict(i) == Verdict::kStill || points.at(slot).is_suspect))
                observation.point = points.handle_of(slot);
        }
        map.add_observation(handle, observation, frame.descriptor(i));
    }
    map.attach(handle);
    std::uint32_t added = 0;
    for (std::size_t i = 0; i < frame.size(); ++i) {
        if (!matcher.claim(i).is_free() || !frame[i].has_depth()) continue;
        const bool may_move = is_suspicious(source, i);
        const WeightParameters& weights = parameters_->weights;
        add_point(source, i, handle, may_move ? weights.suspicious : weights.eligible, world);
        added += may_move ? 0U : 1U;
    }
    if (world.depth_images.is_on()) keep_depth(source, {handle, SE3{}, source.posed.number, false}, world);
    frame_ = source.posed.number;
    tracked_ = source.static_count + added / parameters_->keyframes.new_per_tracked;
    ++world.statistics.keyframes_made;
    if (is_mapping && !world.queue_keyframe(handle)) ++world.statistics.keyframes_refused;
    return static_cast<double>(added) / static_cast<double>(std::max(source.static_count + added, 1U));
}

void KeyframeInserter::look(const Source& source, World& world) noexcept {
    if (!world.depth_images.is_on()) return;
    if (seconds_between(looked_ns_, source.posed.time_ns) < kLookEvery_s) return;
    Handle<Keyframe> nearest =
        parameters_->mapping.is_enabled ? world.local_map.reference(world.map) : Handle<Keyframe>{};
    if (nearest.is_null()) nearest = world.map.recent_keyframe(0);
    const Keyframe* const keyframe = world.map.keyframes().find(nearest);
    if (keyframe == nullptr) return;
    if (parameters_->mapping.is_enabled) free_space_.ask(source.posed, source.matcher, world);
    const SE3 keyframe_from_camera = keyframe->world_from_camera.inverse() * source.posed.world_from_camera;
    keep_depth(source, {nearest, keyframe_from_camera, source.posed.number, true}, world);
}

// What only misses the threshold does not move: that is a third of the matches in a still room. Of new features those
// are told that came into the room.
void KeyframeInserter::keep_depth(const Source& source, const DepthImages::Owner& owner, World& world) noexcept {
    const MeasuredFrame& frame = source.posed.frame;
    const std::int64_t time_ns = source.posed.time_ns;
    if (begun_ns_ < 0) begun_ns_ = time_ns;
    if (seconds_between(begun_ns_, time_ns) < kLooksAfter_s) return;
    looked_ns_ = time_ns;
    still_depth_.begin(frame.frame(), world.depth_images);
    for (const Correspondence& c : source.matches) {
        const bool is_still = source.judge.verdict(c.feature) == Verdict::kStill;
        if (!c.has_depth || !(is_still || c.is_moving)) continue;
        still_depth_.note(frame.keypoint(c.feature), frame[c.feature].seen_z_m, c.is_moving);
    }
    for (std::size_t i = 0; parameters_->mapping.is_enabled && i < frame.size(); ++i) {
        if (!source.matcher.claim(i).is_free() || !frame[i].has_depth() || !free_space_.came(i)) continue;
        still_depth_.note(frame.keypoint(i), frame[i].seen_z_m, true);
    }
    still_depth_.finish(world.depth_images.add(owner, world.map.keyframes()));
}

// What moves, more likely than not: it came into the room, or belongs to a body that moves.
bool KeyframeInserter::is_suspicious(const Source& source, std::size_t feature) const noexcept {
    if (!parameters_->region.is_enabled) return false;
    return has_come(feature) || lies_among_moving(source, feature);
}

bool KeyframeInserter::has_come(std::size_t feature) const noexcept {
    return parameters_->mapping.is_enabled && free_space_.came(feature);
}

// A new feature beside moving ones at the same depth, or beside new ones that came, belongs to the same body more
// likely than not (method.md 7). Suspicion does not spread by itself: where what is suspected alone counted
// as moving, four of five points of a desk beside a person lost their vote at 320x240, and there was a pose in 88
// instead of 98 % of the frames. What came is seen where something known stands behind it: of boxes before a bare wall
// a tenth of the features had nothing behind them, and with the vote of these the boxes were followed.
bool KeyframeInserter::lies_among_moving(const Source& source, std::size_t feature) const noexcept {
    const WeightParameters& weights = parameters_->weights;
    const MeasuredFrame& frame = source.posed.frame;
    const Keypoint& keypoint = frame.keypoint(feature);
    const double z = frame[feature].z_m;
    std::uint32_t moving = 0;
    std::uint32_t still = 0;
    source.matcher.grid().visit_near(static_cast<double>(keypoint.x), static_cast<double>(keypoint.y),
                                     parameters_->matching.radius_wide_px, [&](std::uint32_t i) {
                                         const Verdict verdict = source.judge.verdict(i);
                                         const bool is_new = verdict == Verdict::kNone;
                                         if (verdict == Verdict::kUnclear || (is_new && !has_come(i))) return;
                                         if (!frame[i].has_depth()) return;
                                         const double dz = frame[i].z_m - z;
                                         const double noise = frame[i].var_z + frame[feature].var_z;
                                         const double body = weights.near_m * weights.near_m;
                                         if (dz * dz > body + weights.near_sigmas * weights.near_sigmas * noise) return;
                                         ++(verdict == Verdict::kStill ? still : moving);
                                     });
    return moving > still;
}

void KeyframeInserter::add_point(const Source& source, std::size_t feature, Handle<Keyframe> keyframe,
                                 std::uint32_t weight_tenths, World& world) const noexcept {
    Map& map = world.map;
    const Result<Handle<MapPoint>> taken = map.add_point();
    if (!taken.is_ok()) return;  // all others were seen in this very frame; the pool counts the refusal
    MapPoint& point = *map.points().find(taken.value());
    source.posed.place(feature, point);
    source.posed.anchor(point);
    point.created_ns = source.posed.time_ns;
    point.last_seen_frame = source.posed.number;
    point.weight_tenths = static_cast<std::uint8_t>(weight_tenths);
    point.is_suspect = weight_tenths < parameters_->weights.eligible;
    point.seen = 1;
    static_cast<void>(map.link(keyframe, static_cast<std::uint32_t>(feature), taken.value()));
    world.local_map.add(taken.value().slot());
}

}  // namespace stillmesh
