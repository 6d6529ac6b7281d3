// Is a candidate really the place that it looks like (method.md 9.3), and where from there? Features of a query (a
// frame, or a keyframe) are matched to the static points that a candidate keyframe observes (place_matcher.hpp); 3D-3D
// RANSAC with the points' covariance finds the pose; with it more points of the candidate and its neighbours are
// matched by projection; the pose is adjusted again and judged by how many agree, what share of all matches that is,
// and how far over the image they are spread.
//
// A machine that can stop anywhere: begin(), set_query(), start(), step() until kDone, then is_accepted() and the rest.
// Of the map, what goes while it runs is skipped. Limits: features_max features, kPairsMax pairs.
// Cost: one unit is a residual or 32 descriptors compared; step() overdraws by less than piece_units_max().
#pragma once

#include <cstdint>
#include <span>

#include "engine/base/fixed_vector.hpp"
#include "engine/base/random.hpp"
#include "engine/map/map.hpp"
#include "engine/matching/correspondence.hpp"
#include "engine/parameters.hpp"
#include "engine/pose/pose_optimiser.hpp"
#include "engine/pose/ransac.hpp"
#include "engine/recognition/place_matcher.hpp"
#include "engine/schedule/task.hpp"

namespace stillmesh {

// Why a candidate was not taken.
enum class Refusal : std::uint8_t {
    kNone = 0,
    kFewMatches,  // by descriptor
    kNoPose,      // no motion explains enough of them
    kFewInliers,  // after guided matching
    kNotSpread,   // in a corner of the image
    kFar,         // geometric consistency: farther than the distance limit
    kUnlikely,    // farther from where odometry is than it can have drifted
    kGone,        // the candidate left the map meanwhile
};

// A query feature and the point of the map that it shows.
struct PlaceMatch {
    std::uint16_t feature = 0;
    Handle<MapPoint> point;
};

class PlaceVerifier {
public:
    static constexpr std::uint32_t kPairsMax = 400;

    static constexpr std::uint32_t pairs_max(const Limits& limits) noexcept {
        return limits.features_max / 2 < kPairsMax ? limits.features_max / 2 : kPairsMax;
    }
    static constexpr void plan(ArenaPlan& arena, const Limits& limits) noexcept {
        PlaceMatcher::plan(arena, limits);
        FixedVector<Correspondence>::plan(arena, pairs_max(limits));
        FixedVector<PlaceMatch>::plan(arena, pairs_max(limits));
        FixedVector<std::uint16_t>::plan(arena, pairs_max(limits));
    }
    void create(Arena& arena, const Limits& limits, const Parameters& configuration,
                const CameraModel& camera) noexcept;

    // A new query; forgets everything. Its descriptors are borrowed until the next. Then its features and their direct
    // index, as for the matcher.
    void begin_query(std::span<const Descriptor> descriptors = {}) noexcept;
    void add_feature(const Observation& observation, bool is_eligible) noexcept {
        matcher_.add_feature(observation, is_eligible);
    }
    void end_query(std::span<const WordOfFeature> by_word) noexcept { matcher_.end_query(by_word); }
    [[nodiscard]] const PlaceMatcher& matcher() const noexcept { return matcher_; }

    // What a candidate has to reach: pairs by descriptor, and of those and their neighbours that agree on the pose in
    // the end.
    struct Demands {
        std::uint32_t matches_min = 0, inliers_min = 0;
    };
    // One candidate for the query at hand.
    void start(const Map& map, Handle<Keyframe> candidate, const NoiseFactors& noise, const Demands& demands) noexcept;
    // `candidate_words`: its direct index.
    [[nodiscard]] Progress step(const Map& map, const Vocabulary& vocabulary,
                                std::span<const WordOfFeature> candidate_words, WorkBudget& budget) noexcept;
    void cancel() noexcept { stage_ = Stage::kIdle; }
    [[nodiscard]] bool is_running() const noexcept { return stage_ != Stage::kIdle && stage_ != Stage::kDone; }
    [[nodiscard]] std::uint32_t piece_units_max() const noexcept { return piece_units_max_; }

    // Of the candidate just verified.
    [[nodiscard]] bool is_accepted() const noexcept { return stage_ == Stage::kDone && refusal_ == Refusal::kNone; }
    [[nodiscard]] Refusal refusal() const noexcept { return refusal_; }
    [[nodiscard]] Handle<Keyframe> candidate() const noexcept { return candidate_; }
    [[nodiscard]] const SE3& world_from_query() const noexcept { return fit_.world_from_camera; }
    // Of a right increment of world_from_query().
    [[nodiscard]] const Matrix6& information() const noexcept { return fit_.information; }
    [[nodiscard]] std::uint32_t matches() const noexcept { return matched_; }
    [[nodiscard]] std::uint32_t inliers() const noexcept { return fit_.inliers; }
    // How much the query looks like the candidate just accepted, for two places to be compared: over all features that
    // agree, not only kPairsMax of them, the bits by which their descriptors are nearer than any may be; times as many
    // bits for each point that the place has in view: one that knows half as many points, and shows nearly all of them,
    // is the likelier.
    [[nodiscard]] std::uint64_t likeness(const Map& map) const noexcept;
    // Those that agree.
    [[nodiscard]] std::span<const PlaceMatch> agreeing() const noexcept { return matches_.span(); }

private:
    enum class Stage : std::uint8_t { kIdle, kMatch, kGather, kSample, kRefine, kGuide, kJudge, kDone };
    static constexpr std::uint32_t kNeighboursMax = 8;

    void refuse(Refusal refusal) noexcept;
    [[nodiscard]] std::uint32_t gather(const Map& map) noexcept;
    [[nodiscard]] std::uint32_t sample() noexcept;
    [[nodiscard]] std::uint32_t refine() noexcept;
    [[nodiscard]] std::uint32_t guide(const Map& map) noexcept;
    [[nodiscard]] std::uint32_t judge(const Map& map) noexcept;
    void collect(const Map& map) noexcept;
    void choose_agreeing(const SE3& world_from_camera, double chi2_max) noexcept;
    [[nodiscard]] RansacOptions options() const noexcept;

    const Parameters* configuration_ = nullptr;  // outlives it
    std::uint32_t width_ = 0, height_ = 0;       // px, of the image
    PlaceMatcher matcher_;
    FixedVector<Correspondence> pairs_;
    FixedVector<PlaceMatch> matches_;    // of pairs_, index by index; at the end those that agree
    FixedVector<std::uint16_t> chosen_;  // in pairs_
    std::uint32_t piece_units_max_ = 0;

    Stage stage_ = Stage::kIdle;
    Refusal refusal_ = Refusal::kNone;
    Handle<Keyframe> candidate_;
    Handle<Keyframe> sources_[kNeighboursMax + 1];  // the candidate and its neighbours
    std::uint32_t source_count_ = 0;
    std::uint32_t source_ = 0;
    NoiseFactors noise_;
    Demands demands_;
    std::uint32_t cursor_ = 0;
    std::uint32_t iterations_ = 0, iterations_wanted_ = 0;
    std::uint32_t matched_ = 0;
    double best_weight_ = 0;
    SE3 best_;
    PoseFit fit_;
    Random random_{1};
};

}  // namespace stillmesh
