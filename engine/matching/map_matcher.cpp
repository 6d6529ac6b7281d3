#include "engine/matching/map_matcher.hpp"

#include <algorithm>

#include "engine/base/numbers.hpp"
#include "engine/features/hamming.hpp"
#include "engine/geometry/camera.hpp"

namespace stillmesh {
namespace {

constexpr std::uint32_t kNoDistance = 257;  // more than any two descriptors have

// Turns of the picture are counted in bins of 12 degrees; those of the fullest agree.
constexpr std::int32_t kTurnBins = 30;
constexpr double kTwoPi = 6.283185307179586;

// Nearer is behind the camera, or in its glass.
constexpr double kNearest_m = 0.1;
// The quick reject before distortion is computed, in image sizes over focal lengths: no lens bends more than this.
constexpr double kMarginFactor = 0.6;
constexpr double kMargin = 0.2;

// The local map's points lie in a pool that is larger than any cache: fetched so many points ahead.
constexpr std::uint32_t kAhead = 8;
constexpr std::size_t kPicked = 64;  // features that are looked at together

std::int32_t turn_bin(float from_rad, float to_rad) noexcept {
    const double turn = (static_cast<double>(to_rad) - static_cast<double>(from_rad)) / kTwoPi;
    const std::int32_t bin = floor_clamped((turn + 2.0) * kTurnBins + 0.5, 0, 4 * kTurnBins);
    return bin % kTurnBins;
}

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
        places_[k] = {keypoint.x, keypoint.y, feature, keypoint.level};
    }
    clear();
}

void MapMatcher::clear() noexcept {
    for (std::size_t i = 0; i < features_->size(); ++i) claims_[i] = Claim{};
}

void MapMatcher::by_projection(const Map& map, const LocalMap* local, const SE3& world_from_camera,
                               double radius_px) noexcept {
    clear();
    project(map, local, world_from_camera, radius_px, nullptr);
}

void MapMatcher::more_by_projection(const Map& map, const LocalMap* local, const SE3& world_from_camera,
                                    double radius_px, std::uint64_t frame) noexcept {
    project(map, local, world_from_camera, radius_px, &frame);
}

void MapMatcher::project(const Map& map, const LocalMap* local, const SE3& world_from_camera, double radius_px,
                         const std::uint64_t* seen_frame) noexcept {
    const bool is_more = seen_frame != nullptr;
    const SE3 camera_from_world = world_from_camera.inverse();
    const double width = camera_.width;
    const double height = camera_.height;
    const double margin_x = kMarginFactor * width / camera_.fx + kMargin;
    const double margin_y = kMarginFactor * height / camera_.fy + kMargin;
    const auto levels = static_cast<std::int32_t>(scale_of_level_.size());
    const Pool<MapPoint>& points = map.points();
    const auto count = local != nullptr ? static_cast<std::uint32_t>(local->points().size()) : points.slots_count();
    for (std::uint32_t at = 0; at < count; ++at) {
        const std::uint32_t slot = local != nullptr ? local->points()[at] : at;
        if (local != nullptr && at + kAhead < count) points.prefetch(local->points()[at + kAhead]);
        if (!points.is_taken(slot)) continue;
        const MapPoint& point = points.at(slot);
        if (is_more && point.last_seen_frame == *seen_frame) continue;
        const Vector3 q = camera_from_world * vector_of(point.world);
        if (q.z() < kNearest_m) continue;
        const Vector2 n(q.x() / q.z(), q.y() / q.z());
        if (n.x() > margin_x || n.x() < -margin_x || n.y() > margin_y || n.y() < -margin_y) continue;
        Vector2 pixel = distort_to_pixel(camera_, n);
        if (readout_s_ > 0 || readout_s_ < 0) {
            const double row_time_s = (pixel.y() / height - 0.5) * readout_s_;
            const Vector3 p = moved_a_little(speed_ * -row_time_s, q);
            if (p.z() < kNearest_m) continue;
            pixel = distort_to_pixel(camera_, Vector2(p.x() / p.z(), p.y() / p.z()));
        }
        if (!(pixel.x() >= 0 && pixel.y() >= 0 && pixel.x() < width && pixel.y() < height)) continue;
        // A point twice as far is seen on the level whose scale is half: which level to expect.
        const double ratio = static_cast<double>(point.distance_m) / q.z() * scale_of_level_[point.level];
        std::int32_t level = 0;
        while (level + 1 < levels &&
               scale_of_level_[static_cast<std::size_t>(level)] * parameters_.level_factor < ratio) {
            ++level;
        }
        const double radius = radius_px * scale_of_level_[static_cast<std::size_t>(level)];
        const Nearest nearest = find_nearest(point.descriptor, pixel, radius, level, is_more);
        if (nearest.best > parameters_.hamming_max) continue;
        // Neighbours on other levels are often the same corner; only rivals on the same level count.
        const bool has_rival = nearest.second != kNoDistance && nearest.second_level == nearest.level;
        const double best_allowed = parameters_.ratio_max * static_cast<double>(nearest.second);
        if (has_rival && static_cast<double>(nearest.best) > best_allowed) continue;
        Claim& claim = claims_[nearest.feature];
        // Whatever the order of the list, the lower slot wins a tie.
        const bool is_nearer =
            nearest.best < claim.distance_bits || (nearest.best == claim.distance_bits && slot < claim.point_slot());
        if (claim.is_free() || is_nearer) claim = {slot + 1, nearest.best};
    }
}

// Those of `count` features that lie in the disc, in `picked`. Five of six do not, and which is anybody's guess: picked
// without a jump. A function of its own, since the registers of a larger one do not suffice.
[[gnu::noinline]] std::size_t MapMatcher::pick(const Place* places, std::size_t count, Disc disc,
                                               std::uint8_t* picked) noexcept {
    std::size_t picked_count = 0;
    for (std::size_t k = 0; k < count; ++k) {
        const double dx = static_cast<double>(places[k].x) - disc.x;
        const double dy = static_cast<double>(places[k].y) - disc.y;
        picked[picked_count] = static_cast<std::uint8_t>(k);
        // Below the lowest level the difference is huge.
        picked_count += static_cast<std::size_t>((places[k].level - disc.lowest_level <= disc.levels) &
                                                 (dx * dx + dy * dy <= disc.radius2));
    }
    return picked_count;
}

MapMatcher::Nearest MapMatcher::find_nearest(const Descriptor& descriptor, const Vector2& pixel, double radius_px,
                                             std::int32_t level, bool is_free_only) const noexcept {
    const Disc disc{pixel.x(), pixel.y(), radius_px * radius_px,
                    static_cast<std::uint32_t>(level) - parameters_.levels_off, 2 * parameters_.levels_off};
    Nearest nearest{parameters_.hamming_max + 1, kNoDistance};
    const auto compare = [&](std::uint32_t feature, std::int32_t feature_level) {
        if (is_free_only && !claims_[feature].is_free()) return;
        const std::uint32_t distance = hamming_distance(features_->descriptors[feature], descriptor);
        if (distance < nearest.best) {
            nearest = {distance, nearest.best, feature, feature_level, nearest.level};
        } else if (distance < nearest.second) {
            nearest.second = distance;
            nearest.second_level = feature_level;
        }
    };
    grid_.visit_rows(pixel.x(), pixel.y(), radius_px, [&](std::size_t begin, std::size_t end) {
        std::uint8_t picked[kPicked];
        for (; begin < end; begin += kPicked) {
            const Place* const some = &places_[begin];
            const std::size_t picked_count = pick(some, std::min(kPicked, end - begin), disc, picked);
            for (std::size_t k = 0; k < picked_count; ++k) compare(some[picked[k]].feature, some[picked[k]].level);
        }
    });
    return nearest;
}

void MapMatcher::by_descriptor(const Map& map, Handle<Keyframe> keyframe) noexcept {
    clear();
    for (const Observation& observation : map.observations(keyframe)) {
        const MapPoint* const point = map.points().find(observation.point);
        if (point == nullptr) continue;
        std::uint32_t best = parameters_.hamming_wide_max + 1;
        std::uint32_t second = kNoDistance;
        std::uint32_t best_feature = 0;
        for (std::size_t i = 0; i < features_->size(); ++i) {
            const std::uint32_t distance = hamming_distance(features_->descriptors[i], point->descriptor);
            if (distance < best) {
                second = best;
                best = distance;
                best_feature = static_cast<std::uint32_t>(i);
            } else if (distance < second) {
                second = distance;
            }
        }
        if (best > parameters_.hamming_wide_max) continue;
        if (static_cast<double>(best) > parameters_.ratio_max * static_cast<double>(second)) continue;
        Claim& claim = claims_[best_feature];
        if (claim.is_free() || best < claim.distance_bits) claim = {observation.point.slot() + 1, best};
    }
    keep_common_turn(map);
}

void MapMatcher::by_words(const Map& map, Handle<Keyframe> keyframe, const Vocabulary& vocabulary, std::uint32_t level,
                          std::span<const WordOfFeature> frame_index,
                          std::span<const WordOfFeature> keyframe_index) noexcept {
    clear();
    const std::span<const Observation> observations = map.observations(keyframe);
    STILLMESH_CHECK(frame_index.size() <= features_->size() && keyframe_index.size() <= observations.size());
    visit_common_nodes(vocabulary, level, keyframe_index, frame_index,
                       [&](std::span<const WordOfFeature> of_keyframe, std::span<const WordOfFeature> of_frame) {
                           for (const WordOfFeature& entry : of_keyframe) {
                               const Handle<MapPoint> handle = observations[entry.feature].point;
                               const MapPoint* const point = map.points().find(handle);
                               if (point == nullptr) continue;
                               std::uint32_t best = kNoDistance;
                               std::uint32_t second = kNoDistance;
                               std::uint32_t best_feature = 0;
                               for (const WordOfFeature& candidate : of_frame) {
                                   const std::uint32_t distance =
                                       hamming_distance(features_->descriptors[candidate.feature], point->descriptor);
                                   if (distance < best) {
                                       second = best;
                                       best = distance;
                                       best_feature = candidate.feature;
                                   } else if (distance < second) {
                                       second = distance;
                                   }
                               }
                               if (best > parameters_.hamming_wide_max) continue;
                               if (static_cast<double>(best) > parameters_.ratio_max * static_cast<double>(second))
                                   continue;
                               Claim& claim = claims_[best_feature];
                               const bool is_nearer =
                                   best < claim.distance_bits ||
                                   (best == claim.distance_bits && handle.slot() < claim.point_slot());
                               if (claim.is_free() || is_nearer) claim = {handle.slot() + 1, best};
                           }
                       });
    keep_common_turn(map);
}

// A camera that rolls turns all descriptors alike: matches that turn otherwise are look-alikes.
void MapMatcher::keep_common_turn(const Map& map) noexcept {
    std::uint32_t counts[kTurnBins] = {};
    const auto bin_of = [&](std::size_t feature) {
        return turn_bin(map.points().at(claims_[feature].point_slot()).angle_rad,
                        features_->keypoints[feature].angle_rad);
    };
    for (std::size_t i = 0; i < features_->size(); ++i) {
        if (!claims_[i].is_free()) ++counts[bin_of(i)];
    }
    bool is_kept[kTurnBins] = {};
    std::uint32_t fullest = 0;
    for (std::uint32_t rank = 0; rank < parameters_.turn_bins; ++rank) {
        std::int32_t best = -1;
        for (std::int32_t bin = 0; bin < kTurnBins; ++bin) {
            if (!is_kept[bin] && counts[bin] > 0 && (best < 0 || counts[bin] > counts[best])) best = bin;
        }
        if (best < 0) break;
        if (rank == 0) fullest = counts[best];
        if (parameters_.turn_factor * counts[best] < fullest) break;  // far from the fullest it is an accident
        is_kept[best] = true;
    }
    for (std::size_t i = 0; i < features_->size(); ++i) {
        if (!claims_[i].is_free() && !is_kept[bin_of(i)]) claims_[i] = Claim{};
    }
}

}  // namespace stillmesh
