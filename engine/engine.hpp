// The front door of the engine: one block of memory in, frames in, poses out. No call here allocates, throws, waits or
// reads a clock. One engine is used by one thread.
//
//   std::span<std::byte> block = ...;                        // bytes_needed(limits), aligned to kArenaAlignment
//   auto engine = Engine::create(block, limits, configuration, camera, kernels);
//   engine.value()->submit(frame);                           // tracks the frame
//   engine.value()->step(units);                             // background work, in the time that is left
//   const PoseEstimate& pose = engine.value()->pose();
#pragma once

#include <cstddef>
#include <cstdint>
#include <span>

#include "engine/base/api.hpp"
#include "engine/base/status.hpp"
#include "engine/configuration.hpp"
#include "engine/features/features.hpp"
#include "engine/frame/frame.hpp"
#include "engine/frame/kernels.hpp"
#include "engine/geometry/camera_model.hpp"
#include "engine/limits.hpp"
#include "engine/map/map_store.hpp"
#include "engine/record/map_file.hpp"
#include "engine/schedule/scheduler.hpp"

namespace stillmesh {

// How far a pose can be trusted.
enum class PoseState : std::uint8_t {
    kNone = 0,       // no pose: the transform is the last one known
    kPredicted = 1,  // no measurement in this frame: carried on from the motion before
    kUnsure = 2,     // measured, but another explanation of the frame is nearly as good
    kTracked = 3,
};
[[nodiscard]] constexpr const char* pose_state_name(PoseState state) noexcept {
    constexpr const char* kNames[] = {"none", "predicted", "unsure", "tracked"};
    return kNames[static_cast<std::uint32_t>(state)];
}

struct RigidTransform {
    double rotation_xyzw[4] = {0, 0, 0, 1};  // unit quaternion
    double translation_m[3] = {0, 0, 0};
};

struct PoseEstimate {
    std::int64_t time_ns = 0;
    PoseState state = PoseState::kNone;
    RigidTransform odom_from_camera;  // continuous
    RigidTransform map_from_odom;     // changed by loop closing and relocalisation alone
    // Of xi in odom_from_camera * exp(xi), xi = [translation m, rotation rad] in the camera frame; row by row.
    double covariance[36] = {};
};

// A keyframe of the map as it lies now. Its name is the number of the frame that it was made from.
inline constexpr std::uint64_t kNoKeyframe = ~std::uint64_t{0};
struct KeyframePose {
    std::uint64_t id = kNoKeyframe;
    std::uint64_t parent_id = kNoKeyframe;  // in the spanning tree
    RigidTransform map_from_camera;
};

// The steps of a frame, for whoever wants to time them.
enum class Stage : std::uint8_t { kPrepare, kFeatures, kMatching, kMesh, kRegion, kPose, kLocalMap, kMapUpdate };
inline constexpr std::uint32_t kStages = 8;
[[nodiscard]] constexpr const char* stage_name(Stage stage) noexcept {
    constexpr const char* kNames[kStages] = {"prepare", "features", "matching",  "mesh",
                                             "region",  "pose",     "local map", "map update"};
    return kNames[static_cast<std::uint32_t>(stage)];
}
// Called at the begin and the end of every stage; the engine itself reads no clock.
struct StageObserver {
    void (*on_stage)(void* user, Stage stage, bool is_begin) noexcept = nullptr;
    void* user = nullptr;
};

struct FrameStatistics {
    std::uint64_t frame = 0;  // 0 for the first
    std::uint32_t features = 0;
    std::uint32_t features_with_depth = 0;
    std::uint32_t matches = 0;
    std::uint32_t static_matches = 0;   // accepted as static under the pose given out
    std::uint32_t dynamic_matches = 0;  // matched, and moving against it
    std::uint32_t mesh_edges = 0;
    std::uint32_t mesh_edges_kept = 0;
    std::uint32_t groups = 0;
    double region_score = 0;   // Eq. 1 of the chosen group
    double region_margin = 0;  // how much better the choice explains the past than the next one, [0, 1]
    bool is_keyframe = false;
    std::uint32_t pose_iterations = 0;
};

struct PoolStatistics {
    std::uint32_t size = 0, high_water = 0, capacity = 0;
};
// What the mapping task has done.
struct MappingStatistics {
    std::uint64_t keyframes_inserted = 0;  // taken from the queue
    std::uint64_t adjustments = 0;         // bundle adjustments started
    std::uint64_t adjustments_dropped = 0;
    std::uint64_t adjustment_slices = 0;
    std::uint64_t adjustment_iterations = 0;
    std::uint64_t observations_found = 0;    // that tracking had missed
    std::uint64_t observations_dropped = 0;  // outliers of an adjustment
    std::uint64_t points_triangulated = 0;
};
// What loop closing and relocalisation have done.
struct LoopStatistics {
    std::uint64_t queries = 0;     // keyframes looked up
    std::uint64_t candidates = 0;  // places verified
    std::uint64_t closed = 0;      // loops that corrected the map
    std::uint64_t confirmed = 0;   // places found again where the map has them already
    // Candidates refused: by geometry, and because they are farther than they can be.
    std::uint64_t refused_matches = 0, refused_pose = 0, refused_inliers = 0, refused_spread = 0;
    std::uint64_t refused_far = 0, refused_unlikely = 0, refused_gone = 0;
    std::uint64_t dropped = 0;  // jobs that were overtaken
    std::uint64_t points_fused = 0, observations_found = 0;
    std::uint64_t graph_iterations = 0;
    std::uint64_t adjustments = 0, adjustments_dropped = 0, adjustment_iterations = 0;  // global
    double largest_correction_m = 0;                                                    // of the camera
    double last_correction_m = 0;
    std::uint64_t relocalisations = 0;
    std::uint64_t matched_by_words = 0;  // keyframes that frames of a lost camera were matched with by words
    std::uint64_t relocalisation_queries = 0, relocalisation_candidates = 0;
};
// What went to the map store and what came back (docs/map-store.md).
struct StoreStatistics {
    std::uint64_t kept = 0;          // regions given to the store
    std::uint64_t known = 0;         // keyframes not given: one that was sees the same place
    std::uint64_t poor = 0;          // likewise: too few static points
    std::uint64_t refused = 0;       // the store had no room at the moment
    std::uint64_t asked = 0;         // questions
    std::uint64_t not_found = 0;     // answers: nothing looks like it
    std::uint64_t late = 0;          // answers given up, or to another question
    std::uint64_t damaged = 0;       // answers that were no region for this engine
    std::uint64_t no_room = 0;       // answers left out: the local map fills the pools
    std::uint64_t returned = 0;      // regions back in the map
    std::uint64_t useful = 0;        // of them, seen by tracking since
    std::uint64_t points_made = 0;   // points that came back with them
    std::uint64_t points_known = 0;  // and those that were still there
    std::uint64_t corrections = 0;   // loops that regions outside follow when they come back
};
struct EngineStatistics {
    std::uint64_t frames = 0;
    std::uint64_t frames_refused = 0;
    std::uint64_t keyframes_made = 0;
    std::uint64_t keyframes_forgotten = 0;
    std::uint64_t points_forgotten = 0;
    std::uint64_t frames_lost = 0;        // state none after the first pose
    std::uint64_t recoveries = 0;         // back from lost against a keyframe
    std::uint64_t keyframes_refused = 0;  // mapping was behind: its queue had no room
    // Of keyframes_forgotten and points_forgotten, by reason.
    std::uint64_t keyframes_evicted = 0;    // to make room
    std::uint64_t keyframes_redundant = 0;  // nearly all they see is seen by others
    std::uint64_t points_culled = 0;        // weak, or moving and not seen again
    std::uint64_t points_emptied = 0;       // their place was seen to be empty
    std::uint64_t points_fused = 0;
    std::uint64_t points_evicted = 0;  // to make room, or with their last keyframe
    PoolStatistics keyframes, map_points;
    PoolStatistics keyframe_queue;  // waiting for mapping
    ScheduleStatistics schedule;
    MappingStatistics mapping;
    LoopStatistics loop;
    StoreStatistics store;
    std::size_t arena_used_bytes = 0;
};

// What tracking saw in the last frame, for drawing and for measuring. Borrowed until the next submit.
struct TrackedFeature {
    float x = 0, y = 0;       // px
    std::int32_t group = -1;  // of the mesh; -1: in none
    bool is_matched = false;
    bool is_static = false;   // voted for the pose given out
    bool is_dynamic = false;  // matched, and judged to move
};
struct TrackedEdge {
    float x0 = 0, y0 = 0, x1 = 0, y1 = 0;  // px
    bool is_kept = false;
};
struct TrackingView {
    std::span<const TrackedFeature> features;
    std::span<const TrackedEdge> edges;
};

// Block size for these limits, bytes; exactly what the engine uses. Valid for limits that validate() accepts. The same
// at compile time, for a static block: engine/static_bytes_needed.hpp.
[[nodiscard]] STILLMESH_API std::size_t bytes_needed(const Limits& limits) noexcept;

// What is wrong with a configuration: the key's name, why, its value and what is allowed, given the other keys;
// key == nullptr: nothing.
struct ConfigurationProblem {
    const char* key = nullptr;
    const char* sentence = nullptr;
    double value = 0;
    double min = 0;
    double max = 0;
};
// Limits that hold together and that handles, links and exact predicates can name: bytes_needed() is valid for them.
[[nodiscard]] STILLMESH_API ConfigurationProblem validate(const Limits& limits) noexcept;
// A configuration within its ranges, without contradictions, and within limits that validate() accepts.
[[nodiscard]] STILLMESH_API ConfigurationProblem validate(const Configuration& configuration,
                                                          const Limits& limits) noexcept;

// What to do with a map that was loaded.
enum class MapUse : std::uint8_t {
    kContinue = 0,  // find the camera in it, then go on mapping
    kLocalise = 1,  // find the camera in it; the map stays as it is
};

class STILLMESH_API Engine {
public:
    // The engine lies inside `block` (at least bytes_needed(limits), aligned to kArenaAlignment), which must outlive
    // it; so must `kernels`, `extractor` (nullptr: the engine's own) and the bytes of `vocabulary` (empty: no place is
    // ever recognised), which are checked here and then used where they lie.
    // `store`: where places go that memory has no room for (nullptr: nowhere; else limits.store_features_max must not
    // be 0); it must outlive the engine. One with regions in it is a map to begin in, as with load_map().
    //   kInvalid  camera larger than the limits, below 33x33 px or not usable, or a configuration that validate()
    //             refuses
    //   kCorrupt  no vocabulary that Vocabulary::open() takes, which says why
    //   kFull     block too small
    [[nodiscard]] static Result<Engine*> create(std::span<std::byte> block, const Limits& limits,
                                                const Configuration& configuration, const CameraModel& camera,
                                                const Kernels& kernels, FeatureExtractor* extractor = nullptr,
                                                std::span<const std::byte> vocabulary = {},
                                                MapStore* store = nullptr) noexcept;

    // Tracks one frame to completion; its pixels are borrowed until the call returns.
    //   kOk       pose() is for this frame, whatever its state
    //   kInvalid  size, stride or format other than the camera's, time not after the last frame's, negative or above
    //             2^62 ns (146 years), or a depth factor that is not positive: the frame is refused and counted,
    //             nothing else changed
    [[nodiscard]] Status submit(const Frame& frame) noexcept;
    // Background work (mapping, then loop closing) for so many work units, to be called between frames: any number of
    // times, 0 included. Without it tracking still tracks. The same submit and step calls give the same bits, however
    // fast the machine is; step(a), step(b) is step(a + b). Rule and bounds: engine/schedule/scheduler.hpp.
    //   kIdle     nothing was waiting: no step is needed before the next submit
    //   kWorking  the units ended first              kDone  finished all that was waiting
    Progress step(std::uint32_t units) noexcept;

    [[nodiscard]] const PoseEstimate& pose() const noexcept;
    [[nodiscard]] const FrameStatistics& frame_statistics() const noexcept;
    [[nodiscard]] EngineStatistics statistics() const noexcept;
    [[nodiscard]] TrackingView tracking_view() noexcept;
    // All keyframes, as many as `out` takes (limits.keyframes_max: all); returns how many were written. With them poses
    // that were given out can be carried along as the map is corrected.
    [[nodiscard]] std::uint32_t keyframes(std::span<KeyframePose> out) const noexcept;
    // The keyframe that saw most of what the last frame was measured against; kNoKeyframe: there is none yet.
    [[nodiscard]] std::uint64_t reference_keyframe() const noexcept;
    // Over everything that has been decided so far: equal on every build, frame by frame.
    [[nodiscard]] std::uint64_t state_hash() const noexcept;

    // --- The map on disk (engine/record/map_file.hpp). `extractor` is a number for whoever made the features: 0 the
    // engine's own.
    // Begins a copy of the map into a workspace of map_copy_bytes(limits), aligned to kArenaAlignment, which is
    // borrowed until step_map_copy is done. A copy that was begun before is dropped.
    //   kOk    kFull  the workspace is too small    kNotFound  there is no map yet
    [[nodiscard]] Status begin_map_copy(std::span<std::byte> workspace, std::uint8_t extractor = 0) noexcept;
    // Goes on with it for so many units, between frames; poses, decisions and the state hash do not change by it. The
    // copy is the map as it is when this says kDone; MapFileWriter makes a file of it.
    //   kIdle  nothing was begun    kWorking  the units ended first    kDone  the workspace is the caller's again
    Progress step_map_copy(std::uint32_t units) noexcept;
    // Forgets everything and takes the map of a file in its place. Nothing is touched unless the whole file is right.
    // Until the camera is found in the map, poses are `none`.
    //   kOk    kNotFound, kEnd, kInvalid, kCorrupt, kFull (larger than the limits)  `problem` says what is wrong
    [[nodiscard]] Status load_map(std::span<const std::byte> file, MapUse use, MapFileProblem& problem,
                                  std::uint8_t extractor = 0) noexcept;
    // Gives the store what it has not been given of the map yet, for so many units; at the end of a run.
    //   kIdle  nothing is left, or there is no store    kWorking  more is waiting, for units or for room in the store
    Progress step_store(std::uint32_t units) noexcept;
    // The hash of the content that a file of this map would carry. Slow: for checkpoints.
    [[nodiscard]] std::uint64_t map_hash() noexcept;

    void set_stage_observer(StageObserver observer) noexcept;
    // Forgets everything: from here on it does what a new engine would do, bit by bit, hash and counters included. Only
    // the pools' high-water marks stay.
    void reset() noexcept;

protected:
    Engine() noexcept = default;  // what it holds lies behind it in the block (engine.cpp)
    ~Engine() = default;
};

}  // namespace stillmesh
