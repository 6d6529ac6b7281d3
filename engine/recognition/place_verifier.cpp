#include "engine/recognition/place_verifier.hpp"

#include <algorithm>

#include "engine/base/numbers.hpp"
#include "engine/features/hamming.hpp"
#include "engine/pose/ransac.hpp"
#include "engine/pose/residual.hpp"

namespace stillmesh {
namespace {

constexpr std::uint32_t kMatchPiece = 1024;  // descriptors compared
constexpr std::uint32_t kSamplePiece = 8;    // hypotheses
constexpr std::uint32_t kGuidePiece = 32;    // points projected
constexpr std::uint32_t kNoDistance = 257;
constexpr double kScaleSlack = 1.6;  // between a feature's scale and the one expected

constexpr std::int32_t kTurnBins = 30;
constexpr double kTwoPi = 6.283185307179586;

std::int32_t turn_bin(float from_rad, float to_rad) noexcept {
    const double turn = (static_cast<double>(to_rad) - static_cast<double>(from_rad)) / kTwoPi;
    return floor_clamped((turn + 2.0) * kTurnBins + 0.5, 0, 4 * kTurnBins) % kTurnBins;
}

}  // namespace

void PlaceVerifier::create(Arena& arena, const Limits& limits, const Configuration& configuration,
                           const CameraModel& camera) noexcept {
    configuration_ = &configuration;
    camera_ = camera;
    grid_.create(arena, limits);
    keypoints_.create(arena, limits.features_max);
    query_.create(arena, limits.features_max);
    by_word_.create(arena, limits.features_max);
    claims_ = arena.array<Claim>(limits.features_max);
    pairs_.create(arena, pairs_max(limits));
    matches_.create(arena, pairs_max(limits));
    chosen_.create(arena, pairs_max(limits));
    projected_ = arena.array<std::uint64_t>(projected_words(limits));
    pixel_noise_.create(configuration, camera);
    const std::uint32_t pairs = pairs_max(limits);
    piece_units_max_ = std::max({(kMatchPiece + limits.features_max) / 32 + 1, kSamplePiece * (pairs + 1),
                                 11 * pairs + pairs * pairs / 64 + limits.features_max / 4 + 1, 8 * kGuidePiece});
    begin_query();
}

void PlaceVerifier::begin_query(std::span<const Descriptor> descriptors) noexcept {
    stage_ = Stage::kIdle;
    query_.clear();
    descriptors_ = descriptors;
    keypoints_.clear();
    by_word_.clear();
    matches_.clear();
    candidate_ = {};
}

void PlaceVerifier::add_feature(const Observation& observation, bool is_eligible) noexcept {
    STILLMESH_CHECK(query_.size() < descriptors_.size() && query_.push(observation));
    // Those that must not vote are put out of every match.
    if (!is_eligible) query_[query_.size() - 1].level = 0xff;
    Keypoint keypoint;
    keypoint.x = observation.x;
    keypoint.y = observation.y;
    STILLMESH_CHECK(keypoints_.push(keypoint));
}

void PlaceVerifier::end_query(std::span<const WordOfFeature> by_word) noexcept {
    STILLMESH_CHECK(by_word.size() <= query_.size());
    grid_.build(camera_.width, camera_.height, keypoints_.span());
    by_word_.clear();
    for (const WordOfFeature& word : by_word) {
        STILLMESH_CHECK(word.feature < query_.size());
        STILLMESH_CHECK(by_word_.push(word));
    }
}

std::uint32_t PlaceVerifier::count_alike(const Map& map, const Vocabulary& vocabulary, Handle<Keyframe> keyframe,
                                         std::span<const WordOfFeature> there) const noexcept {
    const std::span<const Observation> observations = map.observations(keyframe);
    const std::span<const Descriptor> descriptors = map.descriptors(keyframe);
    std::uint32_t turns[kTurnBins] = {};
    const auto look = [&](std::span<const WordOfFeature> mine, std::span<const WordOfFeature> theirs) {
        for (const WordOfFeature a : mine) {
            if (query_[a.feature].level == 0xff) continue;
            std::uint32_t best = configuration_->loop.hamming_max + 1;
            std::uint32_t second = kNoDistance;
            std::uint32_t feature = 0;
            for (const WordOfFeature b : theirs) {
                if (b.feature >= observations.size()) continue;
                const std::uint32_t distance = hamming_distance(descriptors_[a.feature], descriptors[b.feature]);
                if (distance < best) {
                    second = best;
                    best = distance;
                    feature = b.feature;
                } else {
                    second = std::min(second, distance);
                }
            }
            if (best > configuration_->loop.hamming_max) continue;
            if (static_cast<double>(best) > configuration_->loop.ratio_max * static_cast<double>(second)) continue;
            // People look alike everywhere.
            if (!is_static(map.points().find(observations[feature].point), configuration_->weights.eligible)) continue;
            ++turns[turn_bin(observations[feature].angle_rad, query_[a.feature].angle_rad)];
        }
    };
    visit_common_nodes(vocabulary, std::min(kLookLevel, vocabulary.info().levels), by_word_.span(), there, look);
    std::uint32_t alike = 0;
    for (std::uint32_t i = 0; i < kTurnBins; ++i) {
        alike = std::max(alike, turns[i] + turns[(i + 1) % kTurnBins] + turns[(i + 2) % kTurnBins]);
    }
    return alike;
}

void PlaceVerifier::start(const Map& map, Handle<Keyframe> candidate, const NoiseFactors& noise,
                          const Demands& demands) noexcept {
    stage_ = Stage::kMatch;
    refusal_ = Refusal::kNone;
    candidate_ = candidate;
    noise_ = noise;
    demands_ = demands;
    a_ = b_ = b_end_ = 0;
    node_end_ = 0;
    cursor_ = source_ = 0;
    matched_ = 0;
    iterations_ = 0;
    best_votes_ = -1;
    fit_ = PoseFit{};
    matches_.clear();
    for (std::size_t i = 0; i < query_.size(); ++i) claims_[i] = Claim{};
    source_count_ = 0;
    const Keyframe* const keyframe = map.keyframes().find(candidate);
    if (keyframe == nullptr) return refuse(Refusal::kGone);
    // Not by the handle: generations go on through a reset, after which everything is as if new.
    random_ = Random(configuration_->seed ^ (keyframe->frame << 8U));
    sources_[source_count_++] = candidate;
    std::uint32_t best[kNeighboursMax] = {};
    const std::uint32_t count = map.best_covisible(candidate.slot(), best, 15);
    for (std::uint32_t i = 0; i < count; ++i) sources_[source_count_++] = map.keyframes().handle_of(best[i]);
}

void PlaceVerifier::refuse(Refusal refusal) noexcept {
    refusal_ = refusal;
    stage_ = Stage::kDone;
}

Progress PlaceVerifier::step(const Map& map, const Vocabulary& vocabulary,
                             std::span<const WordOfFeature> candidate_words, WorkBudget& budget) noexcept {
    if (!is_running()) return Progress::kIdle;
    while (!budget.is_spent()) {
        if (map.keyframes().find(candidate_) == nullptr) {
            refuse(Refusal::kGone);
            budget.spend(1);
        }
        switch (stage_) {
            case Stage::kIdle:
            case Stage::kDone: return Progress::kDone;
            case Stage::kMatch: budget.spend(match(map, vocabulary, candidate_words)); break;
            case Stage::kGather: budget.spend(gather(map)); break;
            case Stage::kSample: budget.spend(sample()); break;
            case Stage::kRefine: budget.spend(refine()); break;
            case Stage::kGuide: budget.spend(guide(map)); break;
            case Stage::kJudge: budget.spend(judge(map)); break;
        }
    }
    return stage_ == Stage::kDone ? Progress::kDone : Progress::kWorking;
}

void PlaceVerifier::claim(std::uint32_t feature, Handle<MapPoint> point, std::uint32_t distance_bits) noexcept {
    Claim& claim = claims_[feature];
    if (claim.point.is_null() || distance_bits < claim.distance_bits) claim = {point, distance_bits};
}

// Query features in the order of the direct index, each against the candidate's features under the same node.
std::uint32_t PlaceVerifier::match(const Map& map, const Vocabulary& vocabulary,
                                   std::span<const WordOfFeature> there) noexcept {
    const std::span<const Observation> observations = map.observations(candidate_);
    const std::span<const Descriptor> descriptors = map.descriptors(candidate_);
    const std::uint32_t level = std::min(configuration_->loop.nodes_level, vocabulary.info().levels);
    std::uint32_t compared = 0;
    while (a_ < by_word_.size() && compared < kMatchPiece) {
        const WordOfFeature mine = by_word_[a_++];
        ++compared;
        if (mine.word >= node_end_) {
            const WordRange node = vocabulary.node_of(mine.word, level);
            node_end_ = node.end;
            b_ = b_end_;
            while (b_ < there.size() && there[b_].word < node.begin) ++b_;
            b_end_ = b_;
            while (b_end_ < there.size() && there[b_end_].word < node.end) ++b_end_;
        }
        if (query_[mine.feature].level == 0xff) continue;
        std::uint32_t best = configuration_->loop.hamming_max + 1;
        std::uint32_t second = kNoDistance;
        Handle<MapPoint> point;
        for (std::size_t b = b_; b < b_end_; ++b) {
            const std::uint32_t feature = there[b].feature;
            if (feature >= observations.size()) continue;
            ++compared;
            const std::uint32_t distance = hamming_distance(descriptors_[mine.feature], descriptors[feature]);
            if (distance >= second) continue;  // before the point is looked up: that costs ten times as much
            const Handle<MapPoint> seen = observations[feature].point;
            if (!is_static(map.points().find(seen), configuration_->weights.eligible)) continue;
            if (distance < best) {
                second = best;
                best = distance;
                point = seen;
            } else {
                second = distance;
            }
        }
        if (point.is_null()) continue;
        if (static_cast<double>(best) > configuration_->loop.ratio_max * static_cast<double>(second)) continue;
        claim(mine.feature, point, best);
    }
    if (a_ == by_word_.size()) stage_ = Stage::kGather;
    return 1 + compared / 32;
}

// A camera that rolls turns all descriptors alike: matches that turn otherwise are look-alikes.
void PlaceVerifier::keep_common_turn(const Map& map) noexcept {
    std::uint32_t counts[kTurnBins] = {};
    const auto bin_of = [&](std::size_t feature) {
        return turn_bin(map.points().find(claims_[feature].point)->angle_rad, query_[feature].angle_rad);
    };
    for (std::size_t i = 0; i < query_.size(); ++i) {
        if (map.points().find(claims_[i].point) == nullptr) claims_[i] = Claim{};
        if (!claims_[i].point.is_null()) ++counts[bin_of(i)];
    }
    bool is_kept[kTurnBins] = {};
    std::uint32_t fullest = 0;
    for (int rank = 0; rank < 3; ++rank) {
        std::int32_t best = -1;
        for (std::int32_t bin = 0; bin < kTurnBins; ++bin) {
            if (!is_kept[bin] && counts[bin] > 0 && (best < 0 || counts[bin] > counts[best])) best = bin;
        }
        if (best < 0) break;
        if (rank == 0) fullest = counts[best];
        if (10 * counts[best] < fullest) break;  // far from the fullest it is an accident
        is_kept[best] = true;
    }
    for (std::size_t i = 0; i < query_.size(); ++i) {
        if (!claims_[i].point.is_null() && !is_kept[bin_of(i)]) claims_[i] = Claim{};
    }
}

// A query feature and the point that it claims.
Correspondence PlaceVerifier::pair_of(std::size_t i, const MapPoint& point) const noexcept {
    const Observation& o = query_[i];
    Correspondence c;
    c.feature = static_cast<std::uint32_t>(i);
    c.point_slot = claims_[i].point.slot();
    c.normalised = Vector2(static_cast<double>(o.normalised_x), static_cast<double>(o.normalised_y));
    c.has_depth = o.var_z >= 0;
    if (c.has_depth) {
        const auto z = static_cast<double>(o.z_m);
        c.p_camera = Vector3(c.normalised.x() * z, c.normalised.y() * z, z);
        c.var_z = static_cast<double>(o.var_z) * noise_.depth;
    }
    c.var_pixel = pixel_noise_.var(o.level) * noise_.pixel;
    c.p_world = c.p_anchor = vector_of(point.world);
    c.map_var_z = point.var_z * noise_.depth;
    c.map_var_lateral = point.var_lateral * noise_.pixel;
    c.distance_bits = claims_[i].distance_bits;
    return c;
}

// The claims become pairs: of several for one point the nearest, and the nearest of all when there are too many.
void PlaceVerifier::collect(const Map& map) noexcept {
    std::uint32_t histogram[kNoDistance] = {};
    for (std::size_t i = 0; i < query_.size(); ++i) {
        if (!claims_[i].point.is_null()) ++histogram[claims_[i].distance_bits];
    }
    std::uint32_t bits_max = 0;
    for (std::uint32_t sum = 0; bits_max < kNoDistance - 1; ++bits_max) {
        sum += histogram[bits_max];
        if (sum + histogram[bits_max + 1] > pairs_.capacity()) break;
    }
    pairs_.clear();
    matches_.clear();
    for (std::size_t i = 0; i < query_.size(); ++i) {
        const MapPoint* const point = map.points().find(claims_[i].point);
        if (point == nullptr || claims_[i].distance_bits > bits_max || pairs_.is_full()) continue;
        const Correspondence c = pair_of(i, *point);
        bool is_taken = false;
        for (std::size_t k = 0; k < pairs_.size(); ++k) {
            if (pairs_[k].point_slot != c.point_slot) continue;
            is_taken = true;
            if (c.distance_bits < pairs_[k].distance_bits) {
                pairs_[k] = c;
                matches_[k] = {static_cast<std::uint16_t>(i), claims_[i].point};
            }
            break;
        }
        if (is_taken) continue;
        STILLMESH_CHECK(pairs_.push(c));
        STILLMESH_CHECK(matches_.push({static_cast<std::uint16_t>(i), claims_[i].point}));
    }
}

std::uint32_t PlaceVerifier::gather(const Map& map) noexcept {
    keep_common_turn(map);
    collect(map);
    matched_ = static_cast<std::uint32_t>(pairs_.size());
    const std::uint32_t units = 1 + matched_ * matched_ / 64 + static_cast<std::uint32_t>(query_.size()) / 4;
    if (matched_ < demands_.matches_min) {
        refuse(Refusal::kFewMatches);
        return units;
    }
    iterations_wanted_ = configuration_->loop.iterations_max;
    stage_ = Stage::kSample;
    return units;
}

std::uint32_t PlaceVerifier::sample() noexcept {
    const auto count = static_cast<std::uint32_t>(pairs_.size());
    std::uint32_t units = 1;
    for (std::uint32_t n = 0; n < kSamplePiece && iterations_ < iterations_wanted_; ++n, ++iterations_) {
        const std::uint32_t i = random_.below(count);
        const std::uint32_t j = random_.below(count);
        const std::uint32_t k = random_.below(count);
        if (i == j || j == k || i == k) continue;
        if (!pairs_[i].has_depth || !pairs_[j].has_depth || !pairs_[k].has_depth) continue;
        SE3 hypothesis;
        if (!pose_from_three(pairs_[i], pairs_[j], pairs_[k], hypothesis)) continue;
        units += count;
        const SE3 camera_from_world = hypothesis.inverse();
        std::uint32_t agreeing = 0;
        for (const Correspondence& c : pairs_) {
            agreeing += chi2_of(c, camera_from_world) <= configuration_->loop.chi2_max ? 1U : 0U;
        }
        if (static_cast<double>(agreeing) <= best_votes_) continue;
        best_votes_ = agreeing;
        best_ = hypothesis;
        const double share = std::max(best_votes_ / static_cast<double>(count), 0.05);
        iterations_wanted_ = std::min(
            configuration_->loop.iterations_max,
            3 * ransac_iterations(configuration_->pose.confidence, share, configuration_->loop.iterations_max));
    }
    if (iterations_ < iterations_wanted_) return units;
    if (best_votes_ < configuration_->loop.first_inliers_min) {
        refuse(Refusal::kNoPose);
    } else {
        stage_ = Stage::kRefine;
    }
    return units;
}

std::uint32_t PlaceVerifier::choose_agreeing(const SE3& world_from_camera, double chi2_max) noexcept {
    const SE3 camera_from_world = world_from_camera.inverse();
    chosen_.clear();
    for (std::size_t i = 0; i < pairs_.size(); ++i) {
        if (chi2_of(pairs_[i], camera_from_world) > chi2_max) continue;
        STILLMESH_CHECK(chosen_.push(static_cast<std::uint16_t>(i)));
    }
    return static_cast<std::uint32_t>(chosen_.size());
}

std::uint32_t PlaceVerifier::refine() noexcept {
    const double chi2_max = configuration_->loop.chi2_max;
    static_cast<void>(choose_agreeing(best_, 2.0 * chi2_max));
    const auto units = static_cast<std::uint32_t>(11 * chosen_.size()) + 1;
    fit_ = optimise_pose(pairs_.span(), chosen_.span(), best_, chi2_max, 10);
    if (!fit_.is_valid || fit_.inliers < configuration_->loop.first_inliers_min) {
        refuse(Refusal::kNoPose);
        return units;
    }
    // Only what agrees keeps its claim; the rest may be claimed anew.
    static_cast<void>(choose_agreeing(fit_.world_from_camera, chi2_max));
    for (std::size_t i = 0; i < query_.size(); ++i) claims_[i] = Claim{};
    for (const std::uint16_t i : chosen_) {
        claims_[matches_[i].feature] = {matches_[i].point, pairs_[i].distance_bits};
    }
    stage_ = Stage::kGuide;
    cursor_ = source_ = 0;
    std::fill(projected_.begin(), projected_.end(), 0);
    offered_ = 0;
    return units;
}

// Neighbours see mostly the same points: each is projected once. True: it had not been.
bool PlaceVerifier::mark_projected(std::uint32_t slot) noexcept {
    std::uint64_t& word = projected_[slot / 64];
    const std::uint64_t before = word;
    word |= std::uint64_t{1} << (slot % 64);
    return word != before;
}

std::uint32_t PlaceVerifier::guide(const Map& map) noexcept {
    std::uint32_t units = 1;
    std::uint32_t points = 0;
    const SE3 camera_from_world = fit_.world_from_camera.inverse();
    while (points < kGuidePiece && source_ < source_count_) {
        const std::span<const Observation> seen = map.observations(sources_[source_]);  // empty when it is gone
        if (cursor_ >= seen.size()) {
            cursor_ = 0;
            ++source_;
            continue;
        }
        ++points;
        const Handle<MapPoint> handle = seen[cursor_++].point;
        const MapPoint* const point = map.points().find(handle);
        if (point == nullptr || !mark_projected(handle.slot())) continue;
        if (!is_static(point, configuration_->weights.eligible)) continue;
        const Vector3 q = camera_from_world * vector_of(point->world);
        if (q.z() < configuration_->depth.z_min_m) continue;
        const Vector2 n(q.x() / q.z(), q.y() / q.z());
        if (n.squaredNorm() > 4.0) continue;
        const Vector2 pixel = distort_to_pixel(camera_, n);
        if (!(pixel.x() >= 0 && pixel.y() >= 0 && pixel.x() < camera_.width && pixel.y() < camera_.height)) continue;
        const double ratio = static_cast<double>(point->distance_m) / q.z() * pixel_noise_.scale(point->level);
        // What is too near or too far has no feature on any level.
        const std::span<const double> scales = pixel_noise_.scales();
        if (ratio * kScaleSlack < scales.front() || ratio > kScaleSlack * scales.back()) continue;
        ++offered_;
        std::uint32_t best = configuration_->loop.hamming_guided_max + 1;
        std::uint32_t best_feature = 0;
        grid_.visit_near(pixel.x(), pixel.y(), configuration_->loop.radius_px * std::max(ratio, 1.0),
                         [&](std::uint32_t i) {
                             const Observation& o = query_[i];
                             if (o.level == 0xff) return;
                             const double scale = pixel_noise_.scale(o.level);
                             if (scale > kScaleSlack * ratio || ratio > kScaleSlack * scale) return;
                             const double dx = static_cast<double>(o.x) - pixel.x();
                             const double dy = static_cast<double>(o.y) - pixel.y();
                             const double radius = configuration_->loop.radius_px * scale;
                             if (dx * dx + dy * dy > radius * radius) return;
                             const std::uint32_t distance = hamming_distance(descriptors_[i], point->descriptor);
                             if (distance >= best) return;
                             best = distance;
                             best_feature = i;
                         });
        units += 2;
        if (best <= configuration_->loop.hamming_guided_max) claim(best_feature, handle, best);
    }
    if (source_ >= source_count_) stage_ = Stage::kJudge;
    return units + points / 4;
}

std::uint32_t PlaceVerifier::judge(const Map& map) noexcept {
    collect(map);
    const double chi2_max = configuration_->loop.chi2_max;
    static_cast<void>(choose_agreeing(fit_.world_from_camera, 2.0 * chi2_max));
    const std::uint32_t units = static_cast<std::uint32_t>(11 * chosen_.size()) + 1 +
                                static_cast<std::uint32_t>(pairs_.size() * pairs_.size() / 64 + query_.size() / 4);
    fit_ = optimise_pose(pairs_.span(), chosen_.span(), fit_.world_from_camera, chi2_max, 10);
    if (!fit_.is_valid || fit_.inliers < demands_.inliers_min) {
        refuse(Refusal::kFewInliers);
        return units;
    }
    static_cast<void>(choose_agreeing(fit_.world_from_camera, chi2_max));
    // One object in a corner may have been moved.
    float x_min = 1e9F, x_max = -1e9F, y_min = 1e9F, y_max = -1e9F;
    std::uint32_t kept = 0;
    for (const std::uint16_t i : chosen_) {
        const PlaceMatch match = matches_[i];
        const Observation& o = query_[match.feature];
        x_min = std::min(x_min, o.x);
        x_max = std::max(x_max, o.x);
        y_min = std::min(y_min, o.y);
        y_max = std::max(y_max, o.y);
        matches_[kept++] = match;  // chosen_ ascends
    }
    matches_.set_size(kept);
    const double spread = configuration_->loop.spread_min;
    if (static_cast<double>(x_max - x_min) < spread * camera_.width ||
        static_cast<double>(y_max - y_min) < spread * camera_.height) {
        refuse(Refusal::kNotSpread);
        return units;
    }
    stage_ = Stage::kDone;
    return units;
}

std::uint64_t PlaceVerifier::likeness(const Map& map) const noexcept {
    const std::uint32_t bits_max = configuration_->loop.hamming_guided_max;
    const SE3 camera_from_world = fit_.world_from_camera.inverse();
    std::uint64_t sum = 0;
    for (std::size_t i = 0; i < query_.size(); ++i) {
        const MapPoint* const point = map.points().find(claims_[i].point);
        if (point == nullptr || claims_[i].distance_bits > bits_max) continue;
        if (chi2_of(pair_of(i, *point), camera_from_world) > configuration_->loop.chi2_max) continue;
        sum += bits_max + 1 - claims_[i].distance_bits;
    }
    return sum * sum / std::max(offered_, 1U);
}

}  // namespace stillmesh
