#include "engine/map/local_map.hpp"

#include <algorithm>
#include <cmath>

#include "engine/base/sort.hpp"
#include "engine/geometry/view_distance.hpp"

namespace stillmesh {
namespace {

// Points lie in a pool that is larger than any cache: fetched so many ahead.
constexpr std::uint32_t kAhead = 8;
constexpr std::uint8_t kRoundMax = 0xfe;  // a round may take two marks

}  // namespace

void LocalMap::create(Arena& arena, const Limits& limits, const LocalMapParameters& parameters,
                      double view_cosine) noexcept {
    parameters_ = parameters;
    // Until the list is out of date the camera may turn by that much more: cos(a + b).
    const double turned = std::max(1.0 - parameters.moved_m * parameters.moved_m / kTurn_m2, 0.0);
    const double sine = std::sqrt(std::max(1.0 - view_cosine * view_cosine, 0.0));
    const double turned_sine = std::sqrt(std::max(1.0 - turned * turned, 0.0));
    cone_cosine_ = std::max(view_cosine * turned - sine * turned_sine, 0.0);
    points_.create(arena, points_max(limits));
    listed_ = arena.array<std::uint8_t>(limits.map_points_max);
    is_local_ = arena.array<std::uint8_t>(limits.keyframes_max);
    counts_ = arena.array<std::uint16_t>(limits.keyframes_max);
    kept_counts_ = arena.array<std::uint16_t>(limits.keyframes_max);
    chosen_max_ = std::min(kKeyframesMax, std::max(limits.keyframes_max / 2, 1U));
    reset();
}

void LocalMap::reset() noexcept {
    points_.clear();
    std::fill(listed_.begin(), listed_.end(), std::uint8_t{0});
    std::fill(is_local_.begin(), is_local_.end(), std::uint8_t{0});
    begin_counting();
    round_ = 1;
    is_built_ = false;
}

void LocalMap::begin_counting() noexcept {
    std::fill(counts_.begin(), counts_.end(), std::uint16_t{0});
}

void LocalMap::keep_counts() noexcept {
    std::copy(counts_.begin(), counts_.end(), kept_counts_.begin());
}

// The list may be of the place that was tried.
void LocalMap::restore_counts() noexcept {
    std::copy(kept_counts_.begin(), kept_counts_.end(), counts_.begin());
    invalidate();
}

void LocalMap::count(const Map& map, std::uint32_t point_slot) noexcept {
    map.visit_observers(point_slot, [&](std::uint32_t keyframe) { ++counts_[keyframe]; });
}

Handle<Keyframe> LocalMap::reference(const Map& map) const noexcept {
    std::uint32_t best = 0;
    for (std::uint32_t slot = 1; slot < counts_.size(); ++slot) {
        if (counts_[slot] > counts_[best]) best = slot;
    }
    return counts_[best] == 0 || !map.keyframes().is_taken(best) ? Handle<Keyframe>{} : map.keyframes().handle_of(best);
}

void LocalMap::note_useful(Map& map, std::uint64_t frame) const noexcept {
    for (std::uint32_t slot = 0; slot < counts_.size(); ++slot) {
        if (counts_[slot] > 0 && map.keyframes().is_taken(slot)) map.keyframes().at(slot).last_useful_frame = frame;
    }
}

bool LocalMap::is_stale(const Map& map, const SE3& world_from_camera) const noexcept {
    if (!is_built_ || !(map.recent_keyframe(0) == newest_)) return true;
    const Handle<Keyframe> now = reference(map);
    if (!now.is_null() && !(now == reference_)) return true;
    return view_distance_m2(world_from_camera, built_at_) > parameters_.moved_m * parameters_.moved_m;
}

bool LocalMap::choose(std::uint32_t keyframe_slot) noexcept {
    if (is_local_[keyframe_slot] != 0 || chosen_count_ == chosen_max_) return false;
    is_local_[keyframe_slot] = 1;
    chosen_[chosen_count_++] = keyframe_slot;
    return true;
}

void LocalMap::add(std::uint32_t point_slot) noexcept {
    if (!is_built_ || listed_[point_slot] == round_ || points_.is_full()) return;
    STILLMESH_CHECK(points_.push(point_slot));
    listed_[point_slot] = round_;
}

void LocalMap::build(const Map& map, const SE3& world_from_camera) noexcept {
    reference_ = reference(map);
    newest_ = map.recent_keyframe(0);
    built_at_ = world_from_camera;
    is_built_ = true;
    choose_keyframes(map, world_from_camera);
    list_points(map);
}

void LocalMap::choose_keyframes(const Map& map, const SE3& world_from_camera) noexcept {
    const Pool<Keyframe>& keyframes = map.keyframes();
    std::fill(is_local_.begin(), is_local_.end(), std::uint8_t{0});
    chosen_count_ = 0;
    if (!newest_.is_null()) static_cast<void>(choose(newest_.slot()));
    // Those that share most with the frame.
    const LocalMapParameters& p = parameters_;
    const std::uint32_t sharing_max = std::min(p.sharing_keyframes, kKeyframesMax);
    const std::uint32_t near_max = std::min(p.near_keyframes, kKeyframesMax);
    std::uint32_t sharing[kKeyframesMax] = {};
    std::uint32_t sharing_count = 0;
    for (std::uint32_t slot = 0; slot < counts_.size(); ++slot) {
        if (counts_[slot] == 0 || !keyframes.is_taken(slot)) continue;
        keep_best(std::span(sharing).first(sharing_max), sharing_count, slot,
                  [this](std::uint32_t a, std::uint32_t b) { return counts_[a] > counts_[b]; });
    }
    // Those with a near viewpoint, nearest first.
    struct Near {
        double distance = 0;
        std::uint32_t slot = 0;
    };
    Near near[kKeyframesMax];
    std::uint32_t near_count = 0;
    for (std::uint32_t slot = 0; slot < keyframes.slots_count(); ++slot) {
        if (!keyframes.is_taken(slot)) continue;
        const SE3& pose = keyframes.at(slot).world_from_camera;
        const double away_m2 = view_distance_m2(pose, world_from_camera);
        if (away_m2 > map.parameters().near_m * map.parameters().near_m) continue;
        keep_best(std::span(near).first(near_max), near_count, Near{away_m2, slot},
                  [](const Near& a, const Near& b) { return a.distance < b.distance; });
    }
    // In turns, so that each kind gets its part of a small pool.
    for (std::uint32_t i = 0; i < std::max(sharing_max, near_max); ++i) {
        if (i < sharing_count) static_cast<void>(choose(sharing[i]));
        if (i < near_count) static_cast<void>(choose(near[i].slot));
    }
    std::uint32_t neighbours[kKeyframesMax] = {};
    const std::span<std::uint32_t> best = std::span(neighbours).first(std::min(p.neighbours, kKeyframesMax));
    for (std::uint32_t i = 0; i < chosen_count_ && chosen_count_ < chosen_max_; ++i) {
        const std::uint32_t count = map.best_covisible(chosen_[i], best, map.parameters().shared_min);
        for (std::uint32_t k = 0; k < count; ++k) static_cast<void>(choose(neighbours[k]));
    }
}

// Marks what is in view and lists it in the order of the pool, where memory is read quickest.
void LocalMap::list_points(const Map& map) noexcept {
    const Pool<MapPoint>& points = map.points();
    if (round_ >= kRoundMax) {
        std::fill(listed_.begin(), listed_.end(), std::uint8_t{0});
        round_ = 0;
    }
    ++round_;
    points_.clear();
    std::uint32_t count = 0;
    for (std::uint32_t slot = 0; slot < points.slots_count(); ++slot) {
        if (slot + kAhead < points.slots_count()) points.prefetch(slot + kAhead);
        if (!points.is_taken(slot) || !may_be_seen(points.at(slot))) continue;
        ++count;
        add(slot);
        listed_[slot] = round_;  // though there may be no room for it
    }
    if (count == points_.size()) return;
    // Too many: those of the local keyframes first, then as many as there is room for.
    const std::uint8_t in_view = round_++;
    points_.clear();
    for (std::uint32_t i = 0; i < chosen_count_; ++i) {
        for (const Observation& observation : map.observations(map.keyframes().handle_of(chosen_[i]))) {
            if (observation.point.is_null() || listed_[observation.point.slot()] != in_view) continue;
            if (points.find(observation.point) != nullptr) add(observation.point.slot());
        }
    }
    for (std::uint32_t slot = 0; slot < points.slots_count() && !points_.is_full(); ++slot) {
        if (listed_[slot] == in_view) add(slot);
    }
}

bool LocalMap::may_be_seen(const MapPoint& point) const noexcept {
    const Vector3 ray = vector_of(point.world) - built_at_.translation;
    const double along = built_at_.rotation.col(2).dot(ray);
    if (along <= 0 || along * along < cone_cosine_ * cone_cosine_ * ray.squaredNorm()) return false;
    // Much nearer or farther than where it was made from, and no level of the pyramid shows it as it was.
    const auto made_at = static_cast<double>(point.distance_m);
    return parameters_.farther_max * along >= made_at && along <= parameters_.farther_max * made_at;
}

}  // namespace stillmesh
