// What the engine says of itself: the pose with its state and covariance, what became of a frame, and what the pools
// and tasks have done. Plain data, for every room and every program.
#pragma once

#include <cstddef>
#include <cstdint>
#include <span>

#include "engine/geometry/rigid_transform.hpp"
#include "engine/schedule/scheduler.hpp"

namespace stillmesh {

inline constexpr std::int64_t kNoTime = -1;

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

// Why a pose that was measured is not `tracked`; the first of these that holds.
enum class UnsureReason : std::uint8_t {
    kNone = 0,
    kRival = 1,      // another motion explains what votes as well, or did for some frames within the last second
    kUnclear = 2,    // the motion chosen explains too little of it (region.score_min)
    kFewPoints = 3,  // too few points agree (twice pose.inliers_min)
    kNoDepth = 4,    // too few features have depth, which tells what moves from what stands
    kJump = 5,       // within the last second a pose lay where the motion did not lead, or unsure ones strayed
    kRenewed = 6,    // the last second's path is not known to pose.sure_sigma_m: the map was renewed from few points
    kHint = 7,       // it contradicts what wheels or a gyroscope said, and no point has a past
};
inline constexpr std::size_t kUnsureReasons = 8;
[[nodiscard]] constexpr const char* unsure_reason_name(UnsureReason reason) noexcept {
    constexpr const char* kNames[kUnsureReasons] = {
        "none",     "rival motion", "unclear motion",      "few points",
        "no depth", "jump",         "map newly made here", "against the hint"};
    return kNames[static_cast<std::uint32_t>(reason)];
}

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

// Two keyframes that hold each other: by points that both see, or by a loop that was closed or confirmed between them.
enum class KeyframeLinkKind : std::uint32_t { kCovisible = 0, kLoop = 1 };
inline constexpr std::uint32_t kLoopLinksMax = 64;  // loops that are remembered; the oldest is forgotten
struct KeyframeLink {
    std::uint64_t older_id = kNoKeyframe;
    std::uint64_t newer_id = kNoKeyframe;
    std::uint32_t shared_points = 0;  // that both see
    KeyframeLinkKind kind = KeyframeLinkKind::kCovisible;
};

// The steps of a frame, for timing.
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
    std::uint32_t dynamic_matches = 0;  // matched, and moving against it; the others are neither
    std::uint32_t mesh_edges = 0;
    std::uint32_t mesh_edges_kept = 0;
    std::uint32_t groups = 0;
    double region_score = 0;   // Eq. 1 of the chosen group
    double region_margin = 0;  // how much better the choice explains the past than the next one, [0, 1]
    UnsureReason unsure = UnsureReason::kNone;
    bool is_keyframe = false;
    std::uint32_t pose_iterations = 0;
    // Of the surface in view: what the motion chosen explains, and what its rival does, which region_margin is held
    // against; 0: there is none. (The margin counts what stood still so far; this counts all.)
    double chosen_share = 0;
    double rival_share = 0;
    // Poses given out behind the frame of this time and before this frame were not sure and are seen to have strayed:
    // on the line between the poses of both frames they are nearer to where the camera was. kNoTime: nothing is seen.
    std::int64_t strayed_since_ns = kNoTime;
};

// What was seen at one moment, small: depths along the camera's axis, 0 where nothing was measured. Cell i lies on the
// ray (rays[2 i], rays[2 i + 1], 1) of the camera. What moved then is marked: it is no part of the room, and where it
// was is none.
struct DepthImage {
    static constexpr std::uint16_t kMoving = 0x8000, kDepth = 0x7fff;  // of a cell: the mark, and the depth, mm

    std::uint32_t columns = 0, rows = 0;      // 0: there is none
    std::span<const std::uint16_t> depth_mm;  // row by row
    std::span<const float> rays;
    std::uint64_t frame = 0;         // that it is of
    RigidTransform map_from_camera;  // as the map lies now

    [[nodiscard]] bool is_moving(std::size_t cell) const noexcept { return (depth_mm[cell] & kMoving) != 0; }
    // Measured, and part of the room.
    [[nodiscard]] bool is_still(std::size_t cell) const noexcept { return depth_mm[cell] != 0 && !is_moving(cell); }
};

struct PoolStatistics {
    std::uint32_t size = 0, high_water = 0, capacity = 0;
};
// What the mapping task has done.
struct MappingStatistics {
    std::uint64_t keyframes_inserted = 0;   // taken from the queue
    std::uint64_t adjustments = 0;          // bundle adjustments started
    std::uint64_t adjustments_dropped = 0;  // of them, not finished: the keyframe left, or the whole map moved
    std::uint64_t adjustment_slices = 0;
    std::uint64_t adjustment_iterations = 0;
    std::uint64_t observations_found = 0;    // that tracking had missed
    std::uint64_t observations_dropped = 0;  // outliers of an adjustment
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
// What went to the map store and what came back.
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
// What went from the map, and why.
struct MapStatistics {
    std::uint64_t keyframes_evicted = 0;    // to make room
    std::uint64_t keyframes_redundant = 0;  // nearly all they see is seen by others
    std::uint64_t points_culled = 0;        // weak, or moving and not seen again
    std::uint64_t points_emptied = 0;       // their place was seen to be empty
    std::uint64_t points_fused = 0;
    std::uint64_t points_evicted = 0;  // to make room, or with their last keyframe
};
struct EngineStatistics : MapStatistics {
    std::uint64_t frames = 0;
    std::uint64_t frames_refused = 0;
    std::uint64_t keyframes_made = 0;
    std::uint64_t keyframes_forgotten = 0;
    std::uint64_t points_forgotten = 0;
    std::uint64_t frames_lost = 0;        // state none after the first pose
    std::uint64_t recoveries = 0;         // back from lost against a keyframe
    std::uint64_t keyframes_refused = 0;  // mapping was behind: its queue had no room
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
    bool is_static = false;   // the pose given out was estimated from it
    bool is_dynamic = false;  // matched, and moves
};
struct TrackedEdge {
    float x0 = 0, y0 = 0, x1 = 0, y1 = 0;  // px
    bool is_kept = false;
};
struct TrackingView {
    static constexpr std::uint8_t kByChoice = 1, kByRival = 2;  // of explained_by

    std::span<const TrackedFeature> features;
    std::span<const TrackedEdge> edges;
    // By feature, when the motion was chosen: bits of those that explain it, of the one chosen and of its rival.
    std::span<const std::uint8_t> explained_by{};
};

}  // namespace stillmesh
