// Tracking (paper 2.1): one frame in, one pose out, run to completion. Features are matched to the map around their
// predicted places, the static region is chosen, the pose is estimated from it alone, more of the map is matched with
// that pose, static weights are updated, and a keyframe is made when the paper's conditions say so. Here is the order
// of these steps; each is a unit of its own beside this file.
#pragma once

#include <cstdint>
#include <span>

#include "engine/base/hash.hpp"
#include "engine/outputs.hpp"
#include "engine/tracking/camera_state.hpp"
#include "engine/tracking/empty_places.hpp"
#include "engine/tracking/frame_estimate.hpp"
#include "engine/tracking/frame_view.hpp"
#include "engine/tracking/keyframe_average.hpp"
#include "engine/tracking/keyframe_inserter.hpp"
#include "engine/tracking/lost_camera.hpp"
#include "engine/tracking/measured_frame.hpp"
#include "engine/tracking/point_judge.hpp"
#include "engine/tracking/tracked_shutter.hpp"
#include "engine/world/world.hpp"

namespace stillmesh {

class Tracking {
public:
    static constexpr void plan(ArenaPlan& arena, const Limits& limits) noexcept {
        MeasuredFrame::plan(arena, limits);
        FrameEstimator::plan(arena, limits);
        CameraState::plan(arena, limits);
        KeyframeInserter::plan(arena, limits);
        KeyframeAverage::plan(arena, limits);
        PointJudge::plan(arena, limits);
        FrameView::plan(arena, limits);
    }
    // All outlive it. Without an `extractor` the engine's own; without `relocalisation` a camera that is lost is looked
    // for only near where it was.
    void create(Arena& arena, World& world, const Kernels& kernels, FeatureExtractor* extractor,
                Relocalisation* relocalisation = nullptr) noexcept;
    void reset() noexcept;
    // Where the first frame is, in the map that will be made. False: there is a map.
    [[nodiscard]] bool start_at(const SE3& world_from_camera) noexcept;
    // The map has just been loaded; it was made by `frames` frames until `time_ns`. Where the camera is in it is not
    // known until it is found there; until then there is no pose. Frozen: the map stays as it is, apart from marks of
    // use.
    void begin_in_map(std::uint64_t frames, std::int64_t time_ns, bool is_frozen) noexcept;

    // Both have been validated; no hint: nullptr.
    void track(const Frame& frame, const MotionHint* hint = nullptr) noexcept;

    [[nodiscard]] const FrameStatistics& frame_statistics() const noexcept { return statistics_; }
    [[nodiscard]] TrackingView view() noexcept;
    [[nodiscard]] std::uint64_t reference_keyframe() const noexcept;
    [[nodiscard]] std::uint64_t state_hash() const noexcept { return hash_.value(); }
    [[nodiscard]] const SE3& world_from_camera() const noexcept { return camera_.world_from_camera(); }
    // What is known of the camera after the last frame.
    [[nodiscard]] const CameraState& camera() const noexcept { return camera_; }
    // Of the last frame: which feature was matched to which point.
    [[nodiscard]] std::span<const Correspondence> correspondences() const noexcept {
        return estimator_.correspondences();
    }
    [[nodiscard]] const FeatureSet& features() const noexcept { return measured_.features(); }
    void set_observer(StageObserver observer) noexcept;

private:
    // --- the steps of a frame
    void follow_map() noexcept;
    void measure(const Frame& frame) noexcept;
    void start_map() noexcept;
    void expect() noexcept;
    void estimate() noexcept;
    [[nodiscard]] bool is_young() const noexcept;
    [[nodiscard]] bool follow_motion() noexcept;
    [[nodiscard]] bool return_to_map() noexcept;
    void learn() noexcept;
    void learn_camera() noexcept;
    void doubt_jump(const SE3& found, bool is_sure) noexcept;
    void learn_hints() noexcept;
    void learn_points() noexcept;
    // The frame at hand, where the camera is.
    [[nodiscard]] PosedFrame posed() const noexcept;
    [[nodiscard]] KeyframeInserter::Source source() const noexcept;
    void make_keyframe() noexcept;
    void lose() noexcept;
    void give_out(PoseState state, const Matrix6& information) noexcept;
    void end_frame() noexcept;
    void observe(Stage stage, bool is_begin) const noexcept {
        if (observer_.on_stage != nullptr) observer_.on_stage(observer_.user, stage, is_begin);
    }

    World* world_ = nullptr;
    CameraState camera_;
    LostCamera lost_;
    MeasuredFrame measured_;
    FrameEstimator estimator_;
    TrackedShutter shutter_;
    PointJudge judge_;
    EmptyPlaces empty_places_;
    KeyframeInserter keyframe_inserter_;
    KeyframeAverage keyframe_average_;
    FrameView view_;
    StageObserver observer_;

    RegionContext expected_;  // of the frame at hand
    Estimate estimate_;
    double lag_s_ = 0;                // between its colour and its depth
    std::int64_t time_ns_ = 0;        // of the frame at hand, in the map's clock
    std::int64_t time_shift_ns_ = 0;  // from the frames' clock to the map's
    bool has_time_shift_ = true;      // false: the first frame will tell
    bool has_map_ = false;
    SE3 start_;  // iff has_start_
    bool has_start_ = false;
    StateHash hash_;
    FrameStatistics statistics_;
};

}  // namespace stillmesh
