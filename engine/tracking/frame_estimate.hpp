// From features to a pose (paper 2.1): matches with the map, the mesh over them, the static region, the pose from it
// alone. What comes out is a value: of the world only the local map is kept up to date, and of the camera nothing
// changes, so that any place may be tried. A pose that is accepted is completed by matching more of the map around it.
// Limit: features_max matches. Cost: nearly all of a frame's, beside its features.
#pragma once

#include <cstdint>
#include <span>

#include "engine/base/fixed_vector.hpp"
#include "engine/base/random.hpp"
#include "engine/matching/correspondence.hpp"
#include "engine/matching/map_matcher.hpp"
#include "engine/pose/pose_optimiser.hpp"
#include "engine/static_region/static_region.hpp"
#include "engine/static_region/surface_shares.hpp"
#include "engine/tracking/camera_state.hpp"
#include "engine/tracking/late_depth.hpp"
#include "engine/tracking/measured_frame.hpp"
#include "engine/tracking/tracked_shutter.hpp"
#include "engine/world/world.hpp"

namespace stillmesh {

// Where the camera is, by one frame.
struct Estimate {
    PoseFit fit;
    RegionContext expected;                        // around which the map was searched
    NoiseScale noise;                              // as the frame had to take it
    bool is_valid = false;                         // a pose was found, by at least inliers_min matches
    Contest contest;                               // what else may be the room's motion
    bool is_on_proven = false;                     // most of what is chosen stood still in a frame before
    UnsureReason choice = UnsureReason::kUnclear;  // why it is not clear which region stands still
    UnsureReason unsure = UnsureReason::kUnclear;  // that, or too few matches say so
    [[nodiscard]] bool is_clear() const noexcept { return choice == UnsureReason::kNone; }
    [[nodiscard]] bool is_sure() const noexcept { return unsure == UnsureReason::kNone; }
};

class FrameEstimator {
public:
    static constexpr void plan(ArenaPlan& arena, const Limits& limits) noexcept {
        MapMatcher::plan(arena, limits);
        StaticRegion::plan(arena, limits);
        SurfaceShares::plan(arena, limits);
        FixedVector<Correspondence>::plan(arena, limits.features_max);
        FixedVector<std::uint16_t>::plan(arena, limits.features_max);
        arena.array<std::uint16_t>(limits.features_max);
        arena.array<std::uint8_t>(limits.features_max);
    }
    // World and shutter outlive it.
    void create(Arena& arena, World& world, TrackedShutter& shutter) noexcept;
    void reset() noexcept;
    void set_observer(StageObserver observer) noexcept { observer_ = observer; }

    // A new frame, at `time_ns` in the map's clock: no matches, no groups. It and what is said of its mesh, region and
    // RANSAC are borrowed until the next.
    void begin(MeasuredFrame& frame, std::int64_t time_ns, FrameStatistics& statistics) noexcept;
    // Carries what each row saw to the middle row; `camera_motion` since the last frame.
    void carry_rows(const CameraState& camera, const SE3& camera_motion) noexcept;
    // The pose around the one expected.
    [[nodiscard]] Estimate estimate(const CameraState& camera, const RegionContext& expected) noexcept;
    // What of the map is seen besides, and the pose of all that agrees: for an estimate that was accepted.
    void complete(const CameraState& camera, Estimate& estimate) noexcept;
    // The matches that the matcher has now, for a camera with these habits; those with weight are chosen.
    void take_matches(const NoiseFactors& noise, const RegionContext& expected) noexcept;
    // Nothing was measured: an empty mesh, and no matches.
    void forget() noexcept;

    [[nodiscard]] MapMatcher& matcher() noexcept { return matcher_; }
    [[nodiscard]] const MapMatcher& matcher() const noexcept { return matcher_; }
    [[nodiscard]] std::span<const Correspondence> correspondences() const noexcept { return correspondences_.span(); }
    // Those that stand still under the pose, by index; the judge of points writes them last.
    [[nodiscard]] FixedVector<std::uint16_t>& chosen() noexcept { return chosen_; }
    [[nodiscard]] std::span<const std::uint16_t> groups() const noexcept { return groups_; }  // by feature; or kNoGroup
    // By feature: TrackingView::kByChoice, kByRival.
    [[nodiscard]] std::span<const std::uint8_t> explained_by() const noexcept { return explained_by_; }
    // Marks what moves under this pose, of the matches that are not chosen; how many do. A point moves that lost its
    // weight and is far from where it was first seen, or whose group moves otherwise than the choice. (What only misses
    // the threshold does not: that is a third of the matches in a still room.)
    [[nodiscard]] std::uint32_t mark_moving(const SE3& world_from_camera) noexcept;
    [[nodiscard]] const StaticRegion& region() const noexcept { return region_; }
    [[nodiscard]] Random& random() noexcept { return random_; }
    [[nodiscard]] const MeasuredFrame& frame() const noexcept { return *frame_; }
    [[nodiscard]] std::int64_t time_ns() const noexcept { return time_ns_; }

private:
    [[nodiscard]] std::uint32_t count_proven() const noexcept;
    [[nodiscard]] bool leaves_proven(const CameraState& camera, std::uint32_t proven) const noexcept;
    [[nodiscard]] UnsureReason doubt_of(const Estimate& estimate) const noexcept;
    void carry() noexcept;
    void correct_coarsely(const Estimate& estimate) noexcept;
    void carry_by_rows(std::span<const std::uint16_t> chosen, const SE3& world_from_camera) noexcept;
    void look_where_depth_was(std::span<const std::uint16_t> chosen, const SE3& world_from_camera) noexcept;
    void follow_frame() noexcept;
    void match(const CameraState& camera, Estimate& estimate) noexcept;
    [[nodiscard]] RegionChoice choose_region(Estimate& estimate) noexcept;
    void choose_again(const Estimate& estimate, RegionChoice& choice) noexcept;
    void weigh_by_agreement() noexcept;
    [[nodiscard]] PoseFit fit_pose(const CameraState& camera, const Estimate& estimate,
                                   const RegionChoice& choice) noexcept;
    [[nodiscard]] bool has_prior(const CameraState& camera, const RegionContext& expected,
                                 const SE3& world_from_camera) const noexcept;
    [[nodiscard]] PoseFit optimise(std::span<const std::uint16_t> chosen, const SE3& world_from_camera,
                                   const MotionPrior* prior) const noexcept;
    void gather(const NoiseFactors& noise, const RegionContext& expected) noexcept;
    [[nodiscard]] const LocalMap* local_map_or_none() const noexcept {
        return world_->parameters.mapping.is_enabled ? &world_->local_map : nullptr;
    }
    void observe(Stage stage, bool is_begin) const noexcept {
        if (observer_.on_stage != nullptr) observer_.on_stage(observer_.user, stage, is_begin);
    }

    World* world_ = nullptr;
    TrackedShutter* shutter_ = nullptr;
    LateDepth late_;
    MeasuredFrame* frame_ = nullptr;
    std::int64_t time_ns_ = 0;
    MapMatcher matcher_;
    StaticRegion region_;
    SurfaceShares surfaces_;
    FixedVector<Correspondence> correspondences_;
    FixedVector<std::uint16_t> chosen_;
    std::span<std::uint16_t> groups_;
    std::span<std::uint8_t> explained_by_;
    Random random_{1};
    StageObserver observer_;
    FrameStatistics* statistics_ = nullptr;
};

}  // namespace stillmesh
