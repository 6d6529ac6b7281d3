#include "engine/recognition/place_verifier.hpp"

#include <algorithm>

#include "engine/pose/residual.hpp"

namespace stillmesh {
namespace {

constexpr std::uint32_t kSamplePiece = 8;  // hypotheses
constexpr std::uint32_t kGuidePiece = 32;  // points projected
constexpr std::uint32_t kDistances = 257;  // of two descriptors

}  // namespace

void PlaceVerifier::create(Arena& arena, const Limits& limits, const Parameters& configuration,
                           const CameraModel& camera) noexcept {
    configuration_ = &configuration;
    width_ = camera.width;
    height_ = camera.height;
    matcher_.create(arena, limits, configuration, camera);
    pairs_.create(arena, pairs_max(limits));
    matches_.create(arena, pairs_max(limits));
    chosen_.create(arena, pairs_max(limits));
    const std::uint32_t pairs = pairs_max(limits);
    piece_units_max_ = std::max({PlaceMatcher::match_units_max(limits), kSamplePiece * (pairs + 1),
                                 11 * pairs + pairs * pairs / 64 + limits.features_max / 4 + 1, 8 * kGuidePiece});
    begin_query();
}

void PlaceVerifier::begin_query(std::span<const Descriptor> descriptors) noexcept {
    stage_ = Stage::kIdle;
    matcher_.begin_query(descriptors);
    matches_.clear();
    candidate_ = {};
}

void PlaceVerifier::start(const Map& map, Handle<Keyframe> candidate, const NoiseFactors& noise,
                          const Demands& demands) noexcept {
    stage_ = Stage::kMatch;
    refusal_ = Refusal::kNone;
    candidate_ = candidate;
    noise_ = noise;
    demands_ = demands;
    matcher_.begin_place();
    cursor_ = source_ = 0;
    matched_ = 0;
    iterations_ = 0;
    best_weight_ = -1;
    fit_ = PoseFit{};
    matches_.clear();
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
            case Stage::kMatch:
                budget.spend(matcher_.match(map, vocabulary, candidate_, candidate_words));
                if (matcher_.is_matched()) stage_ = Stage::kGather;
                break;
            case Stage::kGather: budget.spend(gather(map)); break;
            case Stage::kSample: budget.spend(sample()); break;
            case Stage::kRefine: budget.spend(refine()); break;
            case Stage::kGuide: budget.spend(guide(map)); break;
            case Stage::kJudge: budget.spend(judge(map)); break;
        }
    }
    return stage_ == Stage::kDone ? Progress::kDone : Progress::kWorking;
}

// The claims become pairs: of several for one point the nearest, and the nearest of all when there are too many.
void PlaceVerifier::collect(const Map& map) noexcept {
    const std::size_t features = matcher_.query().size();
    std::uint32_t histogram[kDistances] = {};
    for (std::size_t i = 0; i < features; ++i) {
        const PlaceMatcher::Claim& claim = matcher_.claim(i);
        if (!claim.point.is_null()) ++histogram[claim.distance_bits];
    }
    std::uint32_t bits_max = 0;
    for (std::uint32_t sum = 0; bits_max < kDistances - 1; ++bits_max) {
        sum += histogram[bits_max];
        if (sum + histogram[bits_max + 1] > pairs_.capacity()) break;
    }
    pairs_.clear();
    matches_.clear();
    for (std::size_t i = 0; i < features; ++i) {
        const PlaceMatcher::Claim& claim = matcher_.claim(i);
        const MapPoint* const point = map.points().find(claim.point);
        if (point == nullptr || claim.distance_bits > bits_max || pairs_.is_full()) continue;
        const Correspondence c = matcher_.pair_of(i, *point, noise_);
        bool is_taken = false;
        for (std::size_t k = 0; k < pairs_.size(); ++k) {
            if (pairs_[k].point_slot != c.point_slot) continue;
            is_taken = true;
            if (c.distance_bits < pairs_[k].distance_bits) {
                pairs_[k] = c;
                matches_[k] = {static_cast<std::uint16_t>(i), claim.point};
            }
            break;
        }
        if (is_taken) continue;
        STILLMESH_CHECK(pairs_.push(c));
        STILLMESH_CHECK(matches_.push({static_cast<std::uint16_t>(i), claim.point}));
    }
}

std::uint32_t PlaceVerifier::gather(const Map& map) noexcept {
    matcher_.keep_common_turn(map);
    collect(map);
    matched_ = static_cast<std::uint32_t>(pairs_.size());
    const std::uint32_t units = 1 + matched_ * matched_ / 64 + static_cast<std::uint32_t>(matcher_.query().size()) / 4;
    if (matched_ < demands_.matches_min) {
        refuse(Refusal::kFewMatches);
        return units;
    }
    iterations_wanted_ = options().iterations_max;
    stage_ = Stage::kSample;
    return units;
}

RansacOptions PlaceVerifier::options() const noexcept {
    const PoseParameters& pose = configuration_->pose;
    return ransac_options(*configuration_, pose.coarse_factor, pose.inlier_ratio_start);
}

std::uint32_t PlaceVerifier::sample() noexcept {
    const auto count = static_cast<std::uint32_t>(pairs_.size());
    std::uint32_t units = 1;
    for (std::uint32_t n = 0; n < kSamplePiece && iterations_ < iterations_wanted_; ++n, ++iterations_) {
        // One that is drawn twice spans no triangle, which pose_from_three() asks for.
        const std::uint32_t i = random_.below(count);
        const std::uint32_t j = random_.below(count);
        const std::uint32_t k = random_.below(count);
        if (!pairs_[i].has_depth || !pairs_[j].has_depth || !pairs_[k].has_depth) continue;
        SE3 hypothesis;
        if (!pose_from_three(pairs_[i], pairs_[j], pairs_[k], hypothesis)) continue;
        units += count;
        const SE3 camera_from_world = hypothesis.inverse();
        std::uint32_t agreeing = 0;
        for (const Correspondence& c : pairs_)
            agreeing += chi2_of(c, camera_from_world) <= configuration_->region.point_chi2_max ? 1U : 0U;
        if (static_cast<double>(agreeing) <= best_weight_) continue;
        best_weight_ = agreeing;
        best_ = hypothesis;
        const double share = std::max(best_weight_ / static_cast<double>(count), 0.05);
        const RansacOptions o = options();
        iterations_wanted_ =
            std::min(o.iterations_max, o.factor * ransac_iterations(o.confidence, share, o.iterations_max));
    }
    if (iterations_ < iterations_wanted_) return units;
    if (best_weight_ < configuration_->pose.inliers_min) {
        refuse(Refusal::kNoPose);
    } else {
        stage_ = Stage::kRefine;
    }
    return units;
}

void PlaceVerifier::choose_agreeing(const SE3& world_from_camera, double chi2_max) noexcept {
    const SE3 camera_from_world = world_from_camera.inverse();
    chosen_.clear();
    for (std::size_t i = 0; i < pairs_.size(); ++i) {
        if (chi2_of(pairs_[i], camera_from_world) > chi2_max) continue;
        STILLMESH_CHECK(chosen_.push(static_cast<std::uint16_t>(i)));
    }
}

std::uint32_t PlaceVerifier::refine() noexcept {
    const double chi2_max = configuration_->region.point_chi2_max;
    choose_agreeing(best_, 2.0 * chi2_max);
    const auto units = static_cast<std::uint32_t>(11 * chosen_.size()) + 1;
    fit_ = optimise_pose(pairs_.span(), chosen_.span(), best_, chi2_max, 10);
    if (!fit_.is_valid || fit_.inliers < configuration_->pose.inliers_min) {
        refuse(Refusal::kNoPose);
        return units;
    }
    // Only what agrees keeps its claim; the rest may be claimed anew.
    choose_agreeing(fit_.world_from_camera, chi2_max);
    matcher_.clear_claims();
    for (const std::uint16_t i : chosen_)
        matcher_.set_claim(matches_[i].feature, {matches_[i].point, pairs_[i].distance_bits});
    stage_ = Stage::kGuide;
    cursor_ = source_ = 0;
    matcher_.begin_projection();
    return units;
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
        units += matcher_.project(map, seen[cursor_++].point, camera_from_world);
    }
    if (source_ >= source_count_) stage_ = Stage::kJudge;
    return units + points / 4;
}

std::uint32_t PlaceVerifier::judge(const Map& map) noexcept {
    collect(map);
    const double chi2_max = configuration_->region.point_chi2_max;
    choose_agreeing(fit_.world_from_camera, 2.0 * chi2_max);
    const std::uint32_t units =
        static_cast<std::uint32_t>(11 * chosen_.size()) + 1 +
        static_cast<std::uint32_t>(pairs_.size() * pairs_.size() / 64 + matcher_.query().size() / 4);
    fit_ = optimise_pose(pairs_.span(), chosen_.span(), fit_.world_from_camera, chi2_max, 10);
    if (!fit_.is_valid || fit_.inliers < demands_.inliers_min) {
        refuse(Refusal::kFewInliers);
        return units;
    }
    choose_agreeing(fit_.world_from_camera, chi2_max);
    // One object in a corner may have been moved.
    float x_min = 1e9F, x_max = -1e9F, y_min = 1e9F, y_max = -1e9F;
    std::uint32_t kept = 0;
    for (const std::uint16_t i : chosen_) {
        const PlaceMatch match = matches_[i];
        const Observation& o = matcher_.query()[match.feature];
        x_min = std::min(x_min, o.x);
        x_max = std::max(x_max, o.x);
        y_min = std::min(y_min, o.y);
        y_max = std::max(y_max, o.y);
        matches_[kept++] = match;  // chosen_ ascends
    }
    matches_.set_size(kept);
    const double spread = configuration_->loop.spread_min;
    if (static_cast<double>(x_max - x_min) < spread * width_ || static_cast<double>(y_max - y_min) < spread * height_) {
        refuse(Refusal::kNotSpread);
        return units;
    }
    stage_ = Stage::kDone;
    return units;
}

std::uint64_t PlaceVerifier::likeness(const Map& map) const noexcept {
    const std::uint32_t bits_max = configuration_->matching.hamming_max;
    const SE3 camera_from_world = fit_.world_from_camera.inverse();
    std::uint64_t sum = 0;
    for (std::size_t i = 0; i < matcher_.query().size(); ++i) {
        const PlaceMatcher::Claim& claim = matcher_.claim(i);
        const MapPoint* const point = map.points().find(claim.point);
        if (point == nullptr || claim.distance_bits > bits_max) continue;
        if (chi2_of(matcher_.pair_of(i, *point, noise_), camera_from_world) > configuration_->region.point_chi2_max)
            continue;
        sum += bits_max + 1 - claim.distance_bits;
    }
    return sum * sum / std::max(matcher_.points_in_view(), 1U);
}

}  // namespace stillmesh
