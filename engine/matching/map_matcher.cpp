#include "engine/matching/map_matcher.hpp"

#include <algorithm>
#include <cmath>

#include "engine/features/hamming.hpp"
#include "engine/geometry/camera.hpp"
#include "engine/matching/common_turn.hpp"

namespace stillmesh {
namespace {

constexpr std::uint32_t kDistanceMax = 256;  // bits of a descriptor

// Nearer is behind the camera, or in its glass.
constexpr double kNearest_m = 0.1;

// The local map's points lie in a pool that is larger than any cache: fetched so many points ahead.
constexpr std::uint32_t kPointsAhead = 8;
constexpr std::size_t kPicked = 64;  // features that are looked at together

}  // namespace

void MapMatcher::create(Arena& arena, const Limits& limits, const MatchingParameters& parameters,
                        const CameraModel& camera, std::span<const double> scale_of_level) noexcept {
    parameters_ = parameters;
    camera_ = camera;
    scale_of_level_ = scale_of_level;
    grid_.create(arena, limits);
    places_ = arena.array<Place>(limits.features_max);
    claims_ = arena.array<Claim>(limits.features_max);
}

void MapMatcher::begin(const FeatureSet& features) noexcept {
    features_ = &features;
    grid_.build(camera_.width, camera_.height, features.keypoints.span());
    for (std::size_t k = 0; k < features.size(); ++k) {
        const std::uint16_t feature = grid_.in_order()[k];
        const Keypoint& keypoint = features.keypoints[feature];
        places_[k] =
            Place{Pair{static_cast<double>(keypoint.x), static_cast<double>(keypoint.y)}, feature, keypoint.level};
    }
    clear();
}

void MapMatcher::clear() noexcept {
    for (std::size_t i = 0; i < features_->size(); ++i) claims_[i] = Claim{};
}

void MapMatcher::by_projection(const Map& map, const LocalMap* local, const SE3& world_from_camera, double radius_px,
                               const std::uint64_t* more_frame) noexcept {
    const bool is_more = more_frame != nullptr;
    if (!is_more) clear();
    const SE3 camera_from_world = world_from_camera.inverse();
    const auto levels = static_cast<std::int32_t>(scale_of_level_.size());
    const double level_step = levels > 1 ? std::sqrt(scale_of_level_[1] / scale_of_level_[0]) : 1.0;  // half a level
    const Pool<MapPoint>& points = map.points();
    const auto count = local != nullptr ? static_cast<std::uint32_t>(local->points().size()) : points.slots_count();
    for (std::uint32_t at = 0; at < count; ++at) {
        const std::uint32_t slot = local != nullptr ? local->points()[at] : at;
        if (local != nullptr && at + kPointsAhead < count) points.prefetch(local->points()[at + kPointsAhead]);
        if (!points.is_taken(slot)) continue;
        const MapPoint& point = points.at(slot);
        if (is_more && point.last_seen_frame == *more_frame) continue;
        const Vector3 q = camera_from_world * vector_of(point.world);
        Vector2 pixel;
        if (!project(camera_, q, kNearest_m, pixel)) continue;
        if (has_sweep_) {
            const double row = pixel.y() / camera_.height - 0.5;
            if (!project(camera_, moved_a_little(sweep_ * -row, q), kNearest_m, pixel)) continue;
        }
        if (!is_in_picture(camera_, pixel)) continue;
        // A point twice as far is seen on the level whose scale is half: which level to expect.
        const double ratio = static_cast<double>(point.distance_m) / q.z() * scale_of_level_[point.level];
        std::int32_t level = 0;
        while (level + 1 < levels && scale_of_level_[static_cast<std::size_t>(level)] * level_step < ratio) ++level;
        const double radius = radius_px * scale_of_level_[static_cast<std::size_t>(level)];
        const NearestTwo<Found> two = find_nearest(point.descriptor, pixel, radius, level, is_more);
        if (!two.is_any()) continue;
        // Neighbours on other levels are often the same corner; only rivals on the same level count.
        if (two.next.level == two.nearest.level && !two.is_clear(parameters_.ratio_max)) continue;
        claim(two.nearest.feature, slot, two.best);
    }
}

// Whatever the order in which points come, the lower slot wins a tie.
void MapMatcher::claim(std::uint32_t feature, std::uint32_t slot, std::uint32_t distance_bits) noexcept {
    Claim& claim = claims_[feature];
    const bool is_nearer =
        distance_bits < claim.distance_bits || (distance_bits == claim.distance_bits && slot < claim.point_slot());
    if (claim.is_free() || is_nearer) claim = {slot + 1, distance_bits};
}

// Those of `count` features that lie in the disc, in `picked`. Five of six do not, and which is anybody's guess: picked
// without a jump. A function of its own, since the registers of a larger one do not suffice.
[[gnu::noinline]] std::size_t MapMatcher::pick(const Place* places, std::size_t count, Disc disc,
                                               std::uint8_t* picked) noexcept {
    const Pair centre = {disc.x, disc.y};
    std::size_t picked_count = 0;
    for (std::size_t k = 0; k < count; ++k) {
        const Pair off = places[k].at - centre;
        const Pair squares = off * off;
        picked[picked_count] = static_cast<std::uint8_t>(k);
        // Below the lowest level the difference is huge.
        picked_count += static_cast<std::size_t>((places[k].level - disc.lowest_level <= disc.levels) &
                                                 (squares[0] + squares[1] <= disc.radius2));
    }
    return picked_count;
}

NearestTwo<MapMatcher::Found> MapMatcher::find_nearest(const Descriptor& descriptor, const Vector2& pixel,
                                                       double radius_px, std::int32_t level,
                                                       bool is_free_only) const noexcept {
    const Disc disc{pixel.x(), pixel.y(), radius_px * radius_px, static_cast<std::uint32_t>(level) - 1U,
                    2};  // that level and its neighbours
    NearestTwo<Found> two{parameters_.hamming_max};
    const auto compare = [&](std::uint32_t feature, std::int32_t feature_level) {
        if (is_free_only && !claims_[feature].is_free()) return;
        two.offer(hamming_distance(features_->descriptors[feature], descriptor), {feature, feature_level});
    };
    grid_.visit_rows(pixel.x(), pixel.y(), radius_px, [&](std::size_t begin, std::size_t end) {
        std::uint8_t picked[kPicked];
        for (; begin < end; begin += kPicked) {
            const Place* const some = &places_[begin];
            const std::size_t picked_count = pick(some, std::min(kPicked, end - begin), disc, picked);
            for (std::size_t k = 0; k < picked_count; ++k) compare(some[picked[k]].feature, some[picked[k]].level);
        }
    });
    return two;
}

void MapMatcher::by_descriptor(const Map& map, Handle<Keyframe> keyframe) noexcept {
    clear();
    for (const Observation& observation : map.observations(keyframe)) {
        const MapPoint* const point = map.points().find(observation.point);
        if (point == nullptr) continue;
        NearestTwo<std::uint32_t> two{parameters_.hamming_wide_max};
        for (std::uint32_t i = 0; i < features_->size(); ++i)
            two.offer(hamming_distance(features_->descriptors[i], point->descriptor), i);
        if (two.is_any() && two.is_clear(parameters_.ratio_max)) claim(two.nearest, observation.point.slot(), two.best);
    }
    keep_common_turn(map);
}

void MapMatcher::by_words(const Map& map, Handle<Keyframe> keyframe, const Vocabulary& vocabulary, std::uint32_t level,
                          std::span<const WordOfFeature> frame_index,
                          std::span<const WordOfFeature> keyframe_index) noexcept {
    clear();
    const std::span<const Observation> observations = map.observations(keyframe);
    STILLMESH_CHECK(frame_index.size() <= features_->size() && keyframe_index.size() <= observations.size());
    const auto match = [&](std::span<const WordOfFeature> of_keyframe, std::span<const WordOfFeature> of_frame) {
        for (const WordOfFeature& entry : of_keyframe) {
            const Handle<MapPoint> handle = observations[entry.feature].point;
            const MapPoint* const point = map.points().find(handle);
            if (point == nullptr) continue;
            NearestTwo<std::uint32_t> two{kDistanceMax};
            for (const WordOfFeature& candidate : of_frame) {
                two.offer(hamming_distance(features_->descriptors[candidate.feature], point->descriptor),
                          candidate.feature);
            }
            if (two.best > parameters_.hamming_wide_max || !two.is_clear(parameters_.ratio_max)) continue;
            claim(two.nearest, handle.slot(), two.best);
        }
    };
    visit_common_nodes(vocabulary, level, keyframe_index, frame_index, match);
    keep_common_turn(map);
}

void MapMatcher::keep_common_turn(const Map& map) noexcept {
    CommonTurn turn;
    const auto angle_of = [&](const Claim& claim) { return map.points().at(claim.point_slot()).angle_rad; };
    for (std::size_t i = 0; i < features_->size(); ++i) {
        if (!claims_[i].is_free()) turn.add(angle_of(claims_[i]), features_->keypoints[i].angle_rad);
    }
    turn.choose(parameters_.turn_bins);
    for (std::size_t i = 0; i < features_->size(); ++i) {
        if (!claims_[i].is_free() && !turn.has(angle_of(claims_[i]), features_->keypoints[i].angle_rad))
            claims_[i] = Claim{};
    }
}

}  // namespace stillmesh
