// Tracking (paper 2.1): one frame in, one pose out, run to completion. Features are matched to the map around their
// predicted places, the static region is chosen, the pose is estimated from it alone, more of the map is matched with
// that pose, static weights are updated, and a keyframe is made when the paper's conditions say so. Here is the order
// of these steps and what a frame is called afterwards; each step is a unit of its own beside this file.
#pragma once

#include <cstdint>
#include <span>

#include "engine/base/fixed_vector.hpp"
#include "engine/base/hash.hpp"
#include "engine/base/random.hpp"
#include "engine/base/time.hpp"
#include "engine/matching/correspondence.hpp"
#include "engine/matching/map_matcher.hpp"
#include "engine/outputs.hpp"
#include "engine/pose/pose_optimiser.hpp"
#include "engine/static_region/static_region.hpp"
#include "engine/tracking/camera_reach.hpp"
#include "engine/tracking/empty_places.hpp"
#include "engine/tracking/frame_view.hpp"
#include "engine/tracking/keyframe_inserter.hpp"
#include "engine/tracking/keyframe_looks.hpp"
#include "engine/tracking/measured_frame.hpp"
#include "engine/tracking/motion_model.hpp"
#include "engine/tracking/noise_scale.hpp"
#include "engine/tracking/odometry.hpp"
#include "engine/tracking/point_judge.hpp"
#include "engine/tracking/pose_confidence.hpp"
#include "engine/tracking/tracked_shutter.hpp"
#include "engine/world/world.hpp"

namespace stillmesh {

class Relocalisation;

class Tracking {
public:
    static constexpr void plan(ArenaPlan& arena, const Limits& limits) noexcept {
        MeasuredFrame::plan(arena, limits);
        MapMatcher::plan(arena, limits);
        StaticRegion::plan(arena, limits);
        KeyframeLooks::plan(arena, limits);
        FixedVector<Correspondence>::plan(arena, limits.features_max);
        FixedVector<std::uint16_t>::plan(arena, limits.features_max);
        NoiseScale::plan(arena, limits);
        PointJudge::plan(arena, limits);
        arena.array<std::uint16_t>(limits.features_max);
        FrameView::plan(arena, limits);
    }
    void create(Arena& arena, World& world, const Kernels& kernels, FeatureExtractor* extractor) noexcept;
    void reset() noexcept;

    // The frame has been validated.
    void track(const Frame& frame) noexcept;

    [[nodiscard]] const FrameStatistics& frame_statistics() const noexcept { return frame_statistics_; }
    void fill(EngineStatistics& statistics) const noexcept;
    [[nodiscard]] TrackingView view() noexcept;
    [[nodiscard]] std::uint64_t reference_keyframe() const noexcept;
    [[nodiscard]] std::uint64_t state_hash() const noexcept { return hash_.value(); }
    // The map has just been loaded, by somebody who had tracked `frames` until `time_ns`. Where the camera is in it is
    // not known until it is found there; until then there is no pose. Frozen: the map stays as it is, apart from
    // marks of use.
    void begin_in_map(std::uint64_t frames, std::int64_t time_ns, bool is_frozen) noexcept;
    [[nodiscard]] const SE3& world_from_camera() const noexcept { return motion_.world_from_camera(); }
    // Whom a lost camera asks; none without it.
    void set_relocalisation(Relocalisation* relocalisation) noexcept { relocalisation_ = relocalisation; }
    // Of the last frame: which feature was matched to which point.
    [[nodiscard]] std::span<const Correspondence> correspondences() const noexcept { return correspondences_.span(); }
    [[nodiscard]] const FeatureSet& features() const noexcept { return measured_.features(); }
    void set_observer(StageObserver observer) noexcept { observer_ = observer; }

private:
    // --- the steps of a frame
    void follow_map() noexcept;
    void prepare(const Frame& frame) noexcept;
    void start_map() noexcept;
    void predict(const Frame& frame) noexcept;
    // A pose around the one expected, and all that follows from it; false: none, and only statistics of the frame
    // changed. `unexpected`: where nothing foretells the camera it has to be sure, and the depth of this frame to
    // agree.
    [[nodiscard]] bool estimate(const Frame* unexpected) noexcept;
    [[nodiscard]] bool measure(const Frame* unexpected) noexcept;  // the same, but noise that it guessed stays
    void match() noexcept;
    [[nodiscard]] RegionChoice choose_region() noexcept;
    void choose_again(RegionChoice& choice) noexcept;
    void weigh_by_agreement() noexcept;
    [[nodiscard]] PoseFit fit_pose(const RegionChoice& choice) noexcept;
    void match_more(PoseFit& fit) noexcept;
    void accept(const PoseFit& fit, bool is_sure, bool is_choice_clear) noexcept;
    void make_keyframe() noexcept;
    // --- a frame without a pose
    [[nodiscard]] bool recover(const Frame& frame) noexcept;
    [[nodiscard]] bool relocalise(const Frame& frame) noexcept;
    void begin_relocalisation() noexcept;
    [[nodiscard]] bool is_outweighed() noexcept;
    void believe() noexcept;
    void end_probation(bool is_found) noexcept;
    // A map that stays as it is: loaded to localise in, or while it is not sure that the camera is here. In the last
    // frame of a probation, too: a keyframe of its own would be what it looks most alike.
    [[nodiscard]] bool keeps_map() const noexcept { return world_->is_frozen || is_proving_ || probation_frames_ > 0; }
    [[nodiscard]] bool looks_through(const Frame& frame, const SE3& world_from_camera) noexcept;
    [[nodiscard]] bool estimate_at(const Frame& frame, const SE3& world_from_camera, bool is_by_words) noexcept;
    void lose() noexcept;
    // --- at the end of each
    void give_out(PoseState state, const Matrix6& information) noexcept;
    void end_frame() noexcept;

    void gather() noexcept;
    // Carries what each row saw to the middle row; `camera_motion` since the last frame.
    void apply_shutter(const SE3& camera_motion) noexcept;
    // Lost for so long that nothing foretells this frame's pose.
    [[nodiscard]] bool is_out_of_touch() const noexcept {
        return lost_frames_ > world_->configuration.pose.lost_frames_max ||
               (lost_frames_ > 0 &&
                seconds_between(measured_time_ns_, time_ns_) > world_->configuration.prediction.goes_on_s);
    }
    // What is expected weighs nothing beside a good frame, and keeps a poor one from inventing a jump.
    [[nodiscard]] bool has_prior() const noexcept { return motion_.has_velocity() && lost_frames_ == 0; }
    [[nodiscard]] MotionPrior prior() const noexcept {
        return {context_.world_from_camera_predicted, context_.prediction_sigma_m, context_.prediction_sigma_rad};
    }
    [[nodiscard]] PoseFit optimise(std::span<const std::uint16_t> chosen, const SE3& world_from_camera) const noexcept;
    [[nodiscard]] const LocalMap* local_map_or_none() const noexcept {
        return world_->configuration.mapping.is_enabled ? &world_->local_map : nullptr;
    }
    void observe(Stage stage, bool is_begin) const noexcept {
        if (observer_.on_stage != nullptr) observer_.on_stage(observer_.user, stage, is_begin);
    }

    World* world_ = nullptr;  // outlives it
    StageObserver observer_;
    MeasuredFrame measured_;
    MapMatcher matcher_;
    StaticRegion region_;
    KeyframeInserter keyframe_inserter_;
    KeyframeLooks keyframe_looks_;
    FixedVector<Correspondence> correspondences_;
    FixedVector<std::uint16_t> chosen_;  // correspondences that vote for the pose
    NoiseScale noise_;
    PointJudge judge_;
    std::span<std::uint16_t> groups_;  // by feature: its group of the mesh, or kNoGroup
    FrameView view_;

    // What is known from the frames before.
    MotionModel motion_;
    CameraReach reach_;
    TrackedShutter shutter_;
    Odometry odometry_;
    PoseConfidence confidence_;
    EmptyPlaces empty_places_;
    Relocalisation* relocalisation_ = nullptr;
    RegionContext context_;
    Random random_{1};
    double inlier_ratio_ = 0.5;
    std::uint32_t lost_frames_ = 0;
    bool is_choice_sure_ = true;  // of the last frame
    bool has_map_ = false;
    // A camera that was found again where nobody expected it, for as long as it is not believed, and what was before.
    struct Before {
        SE3 world_from_camera;
        Odometry odometry;
        CameraReach reach;
        NoiseFactors noise;
        std::int64_t measured_time_ns = 0;
        std::int64_t start_time_ns = 0;
        std::uint32_t lost_frames = 0;
        std::uint64_t here = 0, elsewhere = 0;  // evidence of all frames since then (relocalisation.hpp)
        std::uint32_t looks = 0;                // so many frames
        bool is_placed = true;
        bool is_by_words = false;
    };
    std::uint32_t probation_frames_ = 0;
    bool is_proving_ = false;  // the frame at hand began on probation and has not been weighed yet
    Before before_;
    bool is_placed_ = true;  // false: a loaded map, and the camera has not been found in it yet

    std::int64_t time_ns_ = 0;           // of the frame at hand, in the map's clock
    std::int64_t measured_time_ns_ = 0;  // of the last pose that was measured
    std::int64_t start_time_ns_ = 0;
    std::int64_t time_shift_ns_ = 0;  // from the frames' clock to the map's
    bool has_time_shift_ = true;      // false: the first frame will tell

    StateHash hash_;
    FrameStatistics frame_statistics_;
    std::uint64_t frames_lost_ = 0;
    std::uint64_t recoveries_ = 0;
};

}  // namespace stillmesh
