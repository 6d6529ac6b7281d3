// Which map point each feature of a frame shows: by projection around where a pose puts the points, or by descriptor
// alone against one keyframe when there is no pose to trust, if there is a vocabulary under the same node of it only.
// One point per feature; the nearer descriptor wins, ties go to the lower slot. Limit: features_max features. Cost: one
// pass over the local map for a projection, features times observations for a keyframe.
#pragma once

#include <cstdint>
#include <span>

#include "engine/features/features.hpp"
#include "engine/geometry/camera_model.hpp"
#include "engine/geometry/se3.hpp"
#include "engine/limits.hpp"
#include "engine/map/local_map.hpp"
#include "engine/map/map.hpp"
#include "engine/matching/feature_grid.hpp"
#include "engine/matching/nearest_two.hpp"
#include "engine/parameters.hpp"
#include "engine/place/bag_of_words.hpp"
#include "engine/place/vocabulary.hpp"

namespace stillmesh {

// A map point's claim to a feature.
struct Claim {
    std::uint32_t point_slot_plus_one = 0;
    std::uint32_t distance_bits = 0;  // Hamming
    [[nodiscard]] bool is_free() const noexcept { return point_slot_plus_one == 0; }
    [[nodiscard]] std::uint32_t point_slot() const noexcept { return point_slot_plus_one - 1; }
};

class MapMatcher {
public:
    static constexpr void plan(ArenaPlan& arena, const Limits& limits) noexcept {
        FeatureGrid::plan(arena, limits);
        arena.array<Place>(limits.features_max);
        arena.array<Claim>(limits.features_max);
    }
    void create(Arena& arena, const Limits& limits, const MatchingParameters& parameters, const CameraModel& camera,
                std::span<const double> scale_of_level) noexcept;

    // The features of a new frame, borrowed until the next; no claims.
    void begin(const FeatureSet& features) noexcept;
    void clear() noexcept;
    // A camera that moves by `sweep` from its first row to its last (translation and rotation, in its own frame) sees a
    // point not where the middle row's camera would. Zero: a global shutter.
    void set_sweep(const Vector6& sweep) noexcept {
        sweep_ = sweep;
        has_sweep_ = sweep.squaredNorm() > 0;
    }
    // Points around their projections: those of `local`, or of the whole map without one. Claims anew; with
    // `more_frame` claims stay as they are, and points that were seen in that frame are passed over.
    void by_projection(const Map& map, const LocalMap* local, const SE3& world_from_camera, double radius_px,
                       const std::uint64_t* more_frame = nullptr) noexcept;
    // The points of a keyframe by ratio test and by agreement on one turn of the picture.
    void by_descriptor(const Map& map, Handle<Keyframe> keyframe) noexcept;

    // The same, but features are only compared under one node of the vocabulary at `level` (method.md 2). The indices
    // are those of the frame's features and of the keyframe's observations.
    void by_words(const Map& map, Handle<Keyframe> keyframe, const Vocabulary& vocabulary, std::uint32_t level,
                  std::span<const WordOfFeature> frame_index, std::span<const WordOfFeature> keyframe_index) noexcept;

    [[nodiscard]] const Claim& claim(std::size_t feature) const noexcept { return claims_[feature]; }
    [[nodiscard]] const FeatureGrid& grid() const noexcept { return grid_; }

private:
    // What a search asks of a feature first; in the order of the grid, since thousands of points search, and with both
    // coordinates in one register: .9 of 73.3 million instructions of a frame.
    using Pair = double __attribute__((vector_size(16)));
    struct Place {
        Pair at = {};  // x and y, px
        std::uint16_t feature = 0;
        std::uint8_t level = 0;
    };
    struct Disc {
        double x, y, radius2;                // px, px^2
        std::uint32_t lowest_level, levels;  // modulo 2^32; how many above it
    };
    static std::size_t pick(const Place* places, std::size_t count, Disc disc, std::uint8_t* picked) noexcept;
    struct Found {
        std::uint32_t feature = 0;
        std::int32_t level = 0;
    };
    [[nodiscard]] NearestTwo<Found> find_nearest(const Descriptor& descriptor, const Vector2& pixel, double radius_px,
                                                 std::int32_t level, bool is_free_only) const noexcept;
    void claim(std::uint32_t feature, std::uint32_t slot, std::uint32_t distance_bits) noexcept;
    void keep_common_turn(const Map& map) noexcept;

    MatchingParameters parameters_;
    CameraModel camera_;
    std::span<const double> scale_of_level_;  // as many as the pyramid has levels
    const FeatureSet* features_ = nullptr;
    Vector6 sweep_ = Vector6::Zero();
    bool has_sweep_ = false;
    FeatureGrid grid_;
    std::span<Place> places_;  // in the order of the grid
    std::span<Claim> claims_;  // by feature
};

}  // namespace stillmesh
