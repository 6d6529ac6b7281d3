// Which features of a query (a frame, or a keyframe) show which points of a place: each feature claims at most one
// point, the one that looks most alike. First through the nodes of the vocabulary (method.md 2) with ratio and
// orientation checks; then, from a pose, by projection. Limits: features_max features; each point is projected once.
// Cost: one unit is 32 descriptors compared, or half a projection; match() takes at most match_units_max() a piece.
#pragma once

#include <cstdint>
#include <span>

#include "engine/base/fixed_vector.hpp"
#include "engine/geometry/camera.hpp"
#include "engine/geometry/pixel_noise.hpp"
#include "engine/map/map.hpp"
#include "engine/matching/correspondence.hpp"
#include "engine/matching/feature_grid.hpp"
#include "engine/parameters.hpp"
#include "engine/place/bag_of_words.hpp"

namespace stillmesh {

class PlaceMatcher {
public:
    // Features under one node of this level of the vocabulary are compared.
    static constexpr std::uint32_t kNodesLevel = 1;

    struct Claim {
        Handle<MapPoint> point;  // null: none
        std::uint32_t distance_bits = 0;
    };

    static constexpr void plan(ArenaPlan& arena, const Limits& limits) noexcept {
        FeatureGrid::plan(arena, limits);
        FixedVector<Observation>::plan(arena, limits.features_max);
        FixedVector<WordOfFeature>::plan(arena, limits.features_max);
        arena.array<Claim>(limits.features_max);
        arena.array<std::uint64_t>(projected_words(limits));
    }
    void create(Arena& arena, const Limits& limits, const Parameters& configuration,
                const CameraModel& camera) noexcept;

    // A new query; forgets everything. Its descriptors are borrowed until the next.
    void begin_query(std::span<const Descriptor> descriptors) noexcept;
    // Its features one by one, as many as descriptors. `observation.point` is of no interest; features that are not
    // eligible match nothing.
    void add_feature(const Observation& observation, bool is_eligible) noexcept;
    // The direct index of all features added.
    void end_query(std::span<const WordOfFeature> by_word) noexcept;
    [[nodiscard]] std::span<const Observation> query() const noexcept { return query_.span(); }

    // A first look, some ten times cheaper than verification: how many features of a keyframe have one of the query
    // that is alike, under nodes of level kCompareLevel, and turned as most are. `there`: the keyframe's direct index.
    static constexpr std::uint32_t kCompareLevel = 2;
    [[nodiscard]] std::uint32_t count_alike(const Map& map, const Vocabulary& vocabulary, Handle<Keyframe> keyframe,
                                            std::span<const WordOfFeature> there) const noexcept;

    // A new place: match() begins anew.
    void begin_place() noexcept;
    // Query features in the order of the direct index, each against the keyframe's features under the same node; a
    // piece each time, until is_matched(). `there`: the keyframe's direct index. Units.
    [[nodiscard]] std::uint32_t match(const Map& map, const Vocabulary& vocabulary, Handle<Keyframe> keyframe,
                                      std::span<const WordOfFeature> there) noexcept;
    [[nodiscard]] bool is_matched() const noexcept { return a_ == by_word_.size(); }
    // A camera that rolls turns all descriptors alike: matches that turn otherwise are look-alikes and lose their
    // claim.
    void keep_common_turn(const Map& map) noexcept;

    void clear_claims() noexcept;
    void set_claim(std::uint32_t feature, const Claim& claim) noexcept { claims_[feature] = claim; }
    [[nodiscard]] const Claim& claim(std::size_t feature) const noexcept { return claims_[feature]; }

    // From a pose: begin, then any points, each once or more.
    void begin_projection() noexcept;
    // The feature that is most alike around the projection of a point claims it, unless it has a better claim. Units.
    std::uint32_t project(const Map& map, Handle<MapPoint> handle, const SE3& camera_from_world) noexcept;
    // Points in view so far.
    [[nodiscard]] std::uint32_t points_in_view() const noexcept { return points_in_view_; }

    // A query feature and the point that it claims.
    [[nodiscard]] Correspondence pair_of(std::size_t feature, const MapPoint& point,
                                         const NoiseFactors& noise) const noexcept;

    static constexpr std::uint32_t match_units_max(const Limits& limits) noexcept {
        return (kMatchPiece + limits.features_max) / 32 + 1;
    }

private:
    static constexpr std::uint32_t kMatchPiece = 1024;  // descriptors compared
    static constexpr std::uint8_t kNotEligible = 0xff;  // as a feature's level

    static constexpr std::uint32_t projected_words(const Limits& limits) noexcept {
        return (limits.map_points_max + 63) / 64;
    }
    struct Alike {
        std::uint32_t feature = 0, distance_bits = 0;
    };
    void offer(std::uint32_t feature, Handle<MapPoint> point, std::uint32_t distance_bits) noexcept;
    void enter_node_of(const WordOfFeature& mine, const Vocabulary& vocabulary,
                       std::span<const WordOfFeature> there) noexcept;
    [[nodiscard]] bool mark_projected(std::uint32_t slot) noexcept;
    [[nodiscard]] Alike find_alike(const MapPoint& point, const Vector2& pixel, double ratio) const noexcept;

    const Parameters* configuration_ = nullptr;  // outlives it
    CameraModel camera_;
    PixelNoise pixel_noise_;
    FeatureGrid grid_;
    FixedVector<Observation> query_;
    std::span<const Descriptor> descriptors_;
    FixedVector<WordOfFeature> by_word_;
    std::span<Claim> claims_;                // by query feature
    std::span<std::uint64_t> projected_;     // a bit for each slot of a point
    std::size_t a_ = 0, b_ = 0, b_end_ = 0;  // in the direct indices
    std::uint32_t node_end_ = 0;
    std::uint32_t points_in_view_ = 0;
};

}  // namespace stillmesh
