// Tracking (paper 2.1): one frame in, one pose out, run to completion. Features are matched to the map around their
// predicted places, the static region is chosen, the pose is estimated from it alone, more of the map is matched with
// that pose, static weights are updated, and a keyframe is made when the paper's conditions say so.
#pragma once

#include <cstdint>
#include <span>

#include "engine/base/fixed_vector.hpp"
#include "engine/base/hash.hpp"
#include "engine/base/random.hpp"
#include "engine/base/ring.hpp"
#include "engine/engine.hpp"
#include "engine/features/orb_extractor.hpp"
#include "engine/geometry/camera.hpp"
#include "engine/geometry/depth_noise.hpp"
#include "engine/map/local_map.hpp"
#include "engine/map/map.hpp"
#include "engine/matching/correspondence.hpp"
#include "engine/matching/map_matcher.hpp"
#include "engine/pose/motion_doubt.hpp"
#include "engine/pose/rolling_shutter.hpp"
#include "engine/static_region/static_region.hpp"

namespace stillmesh {

class Relocalisation;

// A feature with what the depth image and the camera model add to it.
struct MeasuredFeature {
    Vector2 normalised = Vector2::Zero();  // as the middle row's camera has it
    double z_m = 0;
    Vector2 seen = Vector2::Zero();  // as its own row's camera has it
    double seen_z_m = 0;
    double var_z = -1;  // < 0: no usable depth
    double var_pixel = 0;
};

class Tracking {
public:
    // Keyframes that wait for mapping; more are not refined by it.
    static constexpr std::uint32_t kQueueMax = 3;

    static constexpr void plan(ArenaPlan& arena, const Limits& limits) noexcept {
        OrbExtractor::plan(arena, limits);
        FeatureSet::plan(arena, limits.features_max);
        MapMatcher::plan(arena, limits);
        StaticRegion::plan(arena, limits);
        Map::plan(arena, limits);
        LocalMap::plan(arena, limits);
        Ring<Handle<Keyframe>>::plan(arena, kQueueMax);
        arena.array<std::uint8_t>(static_cast<std::size_t>(limits.image_width_max) * limits.image_height_max);
        FixedVector<MeasuredFeature>::plan(arena, limits.features_max);
        FixedVector<Correspondence>::plan(arena, limits.features_max);
        FixedVector<std::uint16_t>::plan(arena, limits.features_max);
        arena.array<std::uint8_t>(limits.features_max);
        arena.array<std::uint16_t>(limits.features_max);
        FixedVector<float>::plan(arena, limits.features_max);
        FixedVector<TrackedFeature>::plan(arena, limits.features_max);
        FixedVector<TrackedEdge>::plan(arena, mesh_edges_max(limits.features_max));
    }
    void create(Arena& arena, const Limits& limits, const Configuration& configuration, const CameraModel& camera,
                const Kernels& kernels, FeatureExtractor* extractor) noexcept;
    void reset() noexcept;

    // The frame has been validated.
    void track(const Frame& frame) noexcept;

    [[nodiscard]] const PoseEstimate& pose() const noexcept { return pose_; }
    [[nodiscard]] const FrameStatistics& frame_statistics() const noexcept { return frame_statistics_; }
    void fill(EngineStatistics& statistics) const noexcept;
    [[nodiscard]] TrackingView view() noexcept;
    [[nodiscard]] std::uint32_t keyframes(std::span<KeyframePose> out) const noexcept;
    [[nodiscard]] std::uint64_t reference_keyframe() const noexcept;
    [[nodiscard]] std::uint64_t state_hash() const noexcept { return hash_.value(); }
    [[nodiscard]] const Map& map() const noexcept { return map_; }
    // For mapping, which works between frames.
    [[nodiscard]] Map& map() noexcept { return map_; }
    [[nodiscard]] LocalMap& local_map() noexcept { return local_map_; }
    [[nodiscard]] Ring<Handle<Keyframe>>& keyframe_queue() noexcept { return keyframe_queue_; }
    [[nodiscard]] std::uint64_t frame() const noexcept { return frame_; }
    // The map's clock: that of the frames, but after the time of a map that was loaded.
    [[nodiscard]] std::int64_t map_time_ns() const noexcept { return last_time_ns_; }
    // The map has just been loaded, by somebody who had tracked `frames` until `time_ns`. Where the camera is in it is
    // not known until recover() finds out; until then there is no pose. Frozen: the map stays as it is, apart from
    // marks of use.
    void begin_in_map(std::uint64_t frames, std::int64_t time_ns, bool is_frozen) noexcept;
    [[nodiscard]] bool is_frozen() const noexcept { return is_frozen_; }
    // How far real noise leaves the model's, as factors of the variances.
    [[nodiscard]] double noise_pixel() const noexcept { return noise_pixel_; }
    [[nodiscard]] double noise_depth() const noexcept { return noise_depth_; }
    // The map around the camera was moved by `correction` (on the left of world coordinates): the camera moves along.
    void follow(const SE3& correction) noexcept;
    // The same after a loop: map_from_odom takes it, odom_from_camera goes on as before.
    void jump(const SE3& correction) noexcept;
    [[nodiscard]] const Configuration& configuration() const noexcept { return configuration_; }
    [[nodiscard]] const CameraModel& camera() const noexcept { return camera_; }
    [[nodiscard]] const SE3& world_from_camera() const noexcept { return world_from_camera_; }
    // Whom a lost camera asks; none without it.
    void set_relocalisation(Relocalisation* relocalisation) noexcept { relocalisation_ = relocalisation; }
    // Of the last frame: which feature was matched to which point.
    [[nodiscard]] std::span<const Correspondence> correspondences() const noexcept { return correspondences_.span(); }
    [[nodiscard]] const FeatureSet& features() const noexcept { return features_; }
    void set_observer(StageObserver observer) noexcept { observer_ = observer; }

private:
    [[nodiscard]] GreyView grey_of(const Frame& frame) noexcept;
    void measure(const Frame& frame) noexcept;
    // Carries what each row saw to the middle row; `camera_motion` since the last frame.
    void apply_shutter(const SE3& camera_motion) noexcept;
    void learn_shutter(const SE3& world_from_camera, bool counts) noexcept;
    void backdate_speed() noexcept;
    void adopt_readout() noexcept;
    [[nodiscard]] Vector3 by_readout(const SE3& world_from_camera, const Vector3& p,
                                     std::size_t feature) const noexcept;
    void predict(const Frame& frame) noexcept;
    void gather_correspondences() noexcept;
    void start_map() noexcept;
    [[nodiscard]] bool estimate() noexcept;
    [[nodiscard]] bool recover() noexcept;
    // Which of the map's keyframes to compare a frame without a pose with.
    [[nodiscard]] Handle<Keyframe> candidate() const noexcept;
    [[nodiscard]] bool relocalise() noexcept;
    [[nodiscard]] Observation observation_of(std::size_t feature) const noexcept;
    void gather_drift(std::int64_t since_ns) noexcept;
    // Which feature was in which group: correspondences are gathered anew afterwards.
    void note_groups() noexcept;
    void choose_again(RegionChoice& choice) noexcept;
    void doubt_jump(const SE3& world_from_camera, bool is_sure) noexcept;
    void judge(const SE3& world_from_camera, bool is_sure) noexcept;
    // Follows how large residuals really are: real rooms and lenses differ from any noise model by factors.
    // `by_group`: each body under its own motion, which does not depend on what was chosen.
    void adapt_noise(const SE3& world_from_camera, std::span<const std::uint16_t> chosen, bool by_group) noexcept;
    [[nodiscard]] bool wants_keyframe() const noexcept;
    void make_keyframe() noexcept;
    [[nodiscard]] bool lies_among_moving(std::size_t feature) const noexcept;
    void add_point(std::size_t feature, Handle<Keyframe> keyframe, std::uint32_t weight_tenths) noexcept;
    // What the local map is chosen by: the keyframes that observe the points this frame voted with.
    void count_observers() noexcept;
    // Points whose place is in view, with depth measured clearly beyond it: after some such frames they leave the map.
    void notice_empty_places(const Frame& frame) noexcept;
    [[nodiscard]] const LocalMap* local_map_or_none() const noexcept {
        return configuration_.mapping.is_enabled ? &local_map_ : nullptr;
    }
    void give_out(PoseState state, const Matrix6& information) noexcept;
    void observe(Stage stage, bool is_begin) const noexcept {
        if (observer_.on_stage != nullptr) observer_.on_stage(observer_.user, stage, is_begin);
    }

    Configuration configuration_;
    CameraModel camera_;
    const Kernels* kernels_ = nullptr;
    FeatureExtractor* extractor_ = nullptr;
    StageObserver observer_;
    OrbExtractor orb_;
    FeatureSet features_;
    MapMatcher matcher_;
    StaticRegion region_;
    Map map_;
    LocalMap local_map_;
    Ring<Handle<Keyframe>> keyframe_queue_;
    DepthNoise noise_;
    std::span<std::uint8_t> grey_;
    FixedVector<MeasuredFeature> measured_;
    FixedVector<Correspondence> correspondences_;
    FixedVector<std::uint16_t> chosen_;  // correspondences that vote for the pose
    FixedVector<float> residuals_;       // scratch of adapt_noise
    std::span<std::uint8_t> verdicts_;   // by feature: 0 not matched, 1 still, 2 moving
    std::span<std::uint16_t> groups_;    // by feature: its group of the mesh, or kNoGroup
    FixedVector<TrackedFeature> view_features_;
    FixedVector<TrackedEdge> view_edges_;
    double scale_[kPyramidLevelsMax] = {};

    // What is known from the frames before.
    SE3 world_from_camera_;           // last pose given out
    SE3 world_from_camera_previous_;  // the one before
    SE3 map_from_odom_;               // what loops and relocalisations have added
    bool has_jumped_ = false;
    double drift_m_ = 0;  // that odometry can have gathered
    Relocalisation* relocalisation_ = nullptr;
    SE3 predicted_;
    RegionContext context_;
    std::int64_t time_ns_ = 0;
    std::int64_t last_time_ns_ = 0;
    std::int64_t measured_time_ns_ = 0;  // of the last pose that was measured
    std::int64_t previous_time_ns_ = 0;
    std::uint64_t frame_ = 0;
    std::uint64_t first_frame_ = 0;   // number of the first frame that was tracked here, beyond a loaded map's
    std::int64_t time_shift_ns_ = 0;  // from the frames' clock to the map's
    bool has_time_shift_ = true;      // false: the first frame will tell
    bool is_frozen_ = false;
    bool is_placed_ = true;  // false: a loaded map, and the camera has not been found in it yet
    std::uint64_t keyframe_frame_ = 0;
    std::uint64_t keyframes_refused_ = 0;  // by the queue
    std::uint32_t empty_cursor_ = 0;       // in the local map's points
    MotionDoubt doubt_;
    RollingShutter shutter_;
    Vector6 pose_by_readout_ = Vector6::Zero();           // of world_from_camera_, per second, in the camera
    Vector6 pose_by_readout_previous_ = Vector6::Zero();  // of world_from_camera_previous_
    Vector6 shutter_speed_ = Vector6::Zero();             // that measured_ was carried with
    Matrix6 map_covariance_ = Matrix6::Zero();  // of the local map against where odometry began; left increments
    Matrix6 covariance_ = Matrix6::Zero();      // of the pose given out
    double renewed_share_ = 0;                  // of the local map that the last keyframe added
    std::uint32_t keyframe_tracked_ = 0;        // static points right after the last keyframe
    std::uint32_t lost_frames_ = 0;
    std::uint32_t static_count_ = 0;
    std::uint32_t new_points_possible_ = 0;
    double inlier_ratio_ = 0.5;
    double noise_pixel_ = 1.0;        // measured variance of the pixel residuals over the modelled one
    double noise_depth_ = 1.0;        // the same of the depth residuals
    std::uint32_t noise_frames_ = 0;  // that they were measured in
    Random random_{1};
    StateHash hash_;
    PoseEstimate pose_;
    FrameStatistics frame_statistics_;
    EngineStatistics statistics_;
    bool has_map_ = false;
    bool has_velocity_ = false;
    std::int64_t start_time_ns_ = 0;
    bool is_choice_sure_ = true;  // of the last frame
};

}  // namespace stillmesh
