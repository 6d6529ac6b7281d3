#include "engine/recognition/place_matcher.hpp"

#include <algorithm>

#include "engine/features/hamming.hpp"
#include "engine/matching/common_turn.hpp"
#include "engine/matching/nearest_two.hpp"

namespace stillmesh {

void PlaceMatcher::create(Arena& arena, const Limits& limits, const Parameters& configuration,
                          const CameraModel& camera) noexcept {
    configuration_ = &configuration;
    camera_ = camera;
    grid_.create(arena, limits);
    query_.create(arena, limits.features_max);
    by_word_.create(arena, limits.features_max);
    claims_ = arena.array<Claim>(limits.features_max);
    projected_ = arena.array<std::uint64_t>(projected_words(limits));
    pixel_noise_.create(configuration, camera);
    begin_query({});
}

void PlaceMatcher::begin_query(std::span<const Descriptor> descriptors) noexcept {
    query_.clear();
    descriptors_ = descriptors;
    by_word_.clear();
}

void PlaceMatcher::add_feature(const Observation& observation, bool is_eligible) noexcept {
    STILLMESH_CHECK(query_.size() < descriptors_.size() && query_.push(observation));
    if (!is_eligible) query_[query_.size() - 1].level = kNotEligible;
}

void PlaceMatcher::end_query(std::span<const WordOfFeature> by_word) noexcept {
    STILLMESH_CHECK(by_word.size() <= query_.size());
    grid_.build(camera_.width, camera_.height, query());
    by_word_.clear();
    for (const WordOfFeature& word : by_word) {
        STILLMESH_CHECK(word.feature < query_.size());
        STILLMESH_CHECK(by_word_.push(word));
    }
}

std::uint32_t PlaceMatcher::count_alike(const Map& map, const Vocabulary& vocabulary, Handle<Keyframe> keyframe,
                                        std::span<const WordOfFeature> there) const noexcept {
    const std::span<const Observation> observations = map.observations(keyframe);
    const std::span<const Descriptor> descriptors = map.descriptors(keyframe);
    CommonTurn turns;
    const auto compare = [&](std::span<const WordOfFeature> mine, std::span<const WordOfFeature> theirs) {
        for (const WordOfFeature a : mine) {
            if (query_[a.feature].level == kNotEligible) continue;
            NearestTwo<std::uint32_t> two{configuration_->matching.hamming_max};
            for (const WordOfFeature b : theirs) {
                if (b.feature >= observations.size()) continue;
                two.offer(hamming_distance(descriptors_[a.feature], descriptors[b.feature]), b.feature);
            }
            if (!two.is_any() || !two.is_clear(configuration_->matching.ratio_max)) continue;
            // People look alike everywhere.
            const Observation& o = observations[two.nearest];
            if (!is_static(map.points().find(o.point), configuration_->weights.eligible)) continue;
            turns.add(o.angle_rad, query_[a.feature].angle_rad);
        }
    };
    visit_common_nodes(vocabulary, std::min(kCompareLevel, vocabulary.info().levels), by_word_.span(), there, compare);
    return turns.count_alike();
}

void PlaceMatcher::begin_place() noexcept {
    a_ = b_ = b_end_ = 0;
    node_end_ = 0;
    points_in_view_ = 0;
    clear_claims();
}

void PlaceMatcher::clear_claims() noexcept {
    std::fill_n(claims_.begin(), query_.size(), Claim{});
}

void PlaceMatcher::offer(std::uint32_t feature, Handle<MapPoint> point, std::uint32_t distance_bits) noexcept {
    Claim& claim = claims_[feature];
    if (claim.point.is_null() || distance_bits < claim.distance_bits) claim = {point, distance_bits};
}

// The keyframe's features under the node of a query feature: from b_ to b_end_.
void PlaceMatcher::enter_node_of(const WordOfFeature& mine, const Vocabulary& vocabulary,
                                 std::span<const WordOfFeature> there) noexcept {
    if (mine.word < node_end_) return;
    const WordRange node = vocabulary.node_of(mine.word, std::min(kNodesLevel, vocabulary.info().levels));
    node_end_ = node.end;
    b_ = b_end_;
    while (b_ < there.size() && there[b_].word < node.begin) ++b_;
    b_end_ = b_;
    while (b_end_ < there.size() && there[b_end_].word < node.end) ++b_end_;
}

std::uint32_t PlaceMatcher::match(const Map& map, const Vocabulary& vocabulary, Handle<Keyframe> keyframe,
                                  std::span<const WordOfFeature> there) noexcept {
    const std::span<const Observation> observations = map.observations(keyframe);
    const std::span<const Descriptor> descriptors = map.descriptors(keyframe);
    std::uint32_t compared = 0;
    while (a_ < by_word_.size() && compared < kMatchPiece) {
        const WordOfFeature mine = by_word_[a_++];
        ++compared;
        enter_node_of(mine, vocabulary, there);
        if (query_[mine.feature].level == kNotEligible) continue;
        NearestTwo<Handle<MapPoint>> two{configuration_->matching.hamming_max};
        for (std::size_t b = b_; b < b_end_; ++b) {
            const std::uint32_t feature = there[b].feature;
            if (feature >= observations.size()) continue;
            ++compared;
            const std::uint32_t distance = hamming_distance(descriptors_[mine.feature], descriptors[feature]);
            if (distance >= two.second) continue;  // before the point is looked up: that costs ten times as much
            const Handle<MapPoint> seen = observations[feature].point;
            if (is_static(map.points().find(seen), configuration_->weights.eligible)) two.offer(distance, seen);
        }
        if (two.is_any() && two.is_clear(configuration_->matching.ratio_max))
            offer(mine.feature, two.nearest, two.best);
    }
    return 1 + compared / 32;
}

void PlaceMatcher::keep_common_turn(const Map& map) noexcept {
    CommonTurn turn;
    for (std::size_t i = 0; i < query_.size(); ++i) {
        const MapPoint* const point = map.points().find(claims_[i].point);
        if (point == nullptr) {
            claims_[i] = Claim{};
        } else {
            turn.add(point->angle_rad, query_[i].angle_rad);
        }
    }
    turn.choose(configuration_->matching.turn_bins);
    for (std::size_t i = 0; i < query_.size(); ++i) {
        const MapPoint* const point = map.points().find(claims_[i].point);
        if (point != nullptr && !turn.has(point->angle_rad, query_[i].angle_rad)) claims_[i] = Claim{};
    }
}

Correspondence PlaceMatcher::pair_of(std::size_t feature, const MapPoint& point,
                                     const NoiseFactors& noise) const noexcept {
    const Observation& o = query_[feature];
    Correspondence c;
    c.feature = static_cast<std::uint32_t>(feature);
    c.point_slot = claims_[feature].point.slot();
    c.normalised = Vector2(static_cast<double>(o.normalised_x), static_cast<double>(o.normalised_y));
    c.has_depth = o.var_z >= 0;
    if (c.has_depth) {
        const auto z = static_cast<double>(o.z_m);
        c.p_camera = Vector3(c.normalised.x() * z, c.normalised.y() * z, z);
        c.var_z = static_cast<double>(o.var_z) * noise.depth;
    }
    c.var_pixel = pixel_noise_.var(o.level) * noise.pixel;
    c.p_world = c.p_anchor = vector_of(point.world);
    c.map_var_z = point.var_z * noise.depth;
    c.map_var_lateral = point.var_lateral * noise.pixel;
    c.distance_bits = static_cast<std::uint16_t>(claims_[feature].distance_bits);
    return c;
}

void PlaceMatcher::begin_projection() noexcept {
    std::fill(projected_.begin(), projected_.end(), 0);
    points_in_view_ = 0;
}

// Neighbours see mostly the same points. True: it had not been projected.
bool PlaceMatcher::mark_projected(std::uint32_t slot) noexcept {
    std::uint64_t& word = projected_[slot / 64];
    const std::uint64_t before = word;
    word |= std::uint64_t{1} << (slot % 64);
    return word != before;
}

// Around `pixel`, at a scale near `ratio`.
PlaceMatcher::Alike PlaceMatcher::find_alike(const MapPoint& point, const Vector2& pixel, double ratio) const noexcept {
    const MatchingParameters& p = configuration_->matching;
    Alike best{0, p.hamming_max + 1};
    grid_.visit_near(pixel.x(), pixel.y(), p.radius_posed_px * kScaleSlack * ratio, [&](std::uint32_t i) {
        const Observation& o = query_[i];
        if (o.level == kNotEligible) return;
        const double scale = pixel_noise_.scale(o.level);
        if (scale > kScaleSlack * ratio || ratio > kScaleSlack * scale) return;
        const double dx = static_cast<double>(o.x) - pixel.x();
        const double dy = static_cast<double>(o.y) - pixel.y();
        const double radius = p.radius_posed_px * scale;
        if (dx * dx + dy * dy > radius * radius) return;
        const std::uint32_t distance = hamming_distance(descriptors_[i], point.descriptor);
        if (distance < best.distance_bits) best = {i, distance};
    });
    return best;
}

std::uint32_t PlaceMatcher::project(const Map& map, Handle<MapPoint> handle, const SE3& camera_from_world) noexcept {
    const MapPoint* const point = map.points().find(handle);
    if (point == nullptr || !mark_projected(handle.slot())) return 0;
    if (!is_static(point, configuration_->weights.eligible)) return 0;
    const Vector3 q = camera_from_world * vector_of(point->world);
    Vector2 pixel;
    if (!visible_pixel(camera_, q, configuration_->depth.z_min_m, pixel)) return 0;
    const double ratio = static_cast<double>(point->distance_m) / q.z() * pixel_noise_.scale(point->level);
    // What is too near or too far has no feature on any level.
    const std::span<const double> scales = pixel_noise_.scales();
    if (ratio * kScaleSlack < scales.front() || ratio > kScaleSlack * scales.back()) return 0;
    ++points_in_view_;
    const Alike best = find_alike(*point, pixel, ratio);
    if (best.distance_bits <= configuration_->matching.hamming_max) offer(best.feature, handle, best.distance_bits);
    return 2;
}

}  // namespace stillmesh
