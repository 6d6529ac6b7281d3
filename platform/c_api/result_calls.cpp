// What the engine says, and trajectories.
#include <memory>
#include <string>
#include <utility>
#include <vector>

#include "platform/c_api/engine_memory.hpp"
#include "platform/evaluation/final_trajectory.hpp"
#include "platform/library/transform.hpp"

// What is lent without a copy is laid out as the engine's own.
static_assert(sizeof(sm_tracked_feature) == sizeof(stillmesh::TrackedFeature) &&
              offsetof(sm_tracked_feature, is_dynamic) == offsetof(stillmesh::TrackedFeature, is_dynamic));
static_assert(sizeof(sm_tracked_edge) == sizeof(stillmesh::TrackedEdge) &&
              offsetof(sm_tracked_edge, is_kept) == offsetof(stillmesh::TrackedEdge, is_kept));
static_assert(sizeof(bool) == 1);
static_assert(stillmesh::TrackingView::kByChoice == SM_BY_CHOICE && stillmesh::TrackingView::kByRival == SM_BY_RIVAL);
static_assert(sizeof(sm_keyframe) == sizeof(stillmesh::KeyframePose) &&
              offsetof(sm_keyframe, map_from_camera) == offsetof(stillmesh::KeyframePose, map_from_camera) &&
              sizeof(sm_transform) == sizeof(stillmesh::RigidTransform));
static_assert(sizeof(sm_keyframe_link) == sizeof(stillmesh::KeyframeLink) &&
              offsetof(sm_keyframe_link, kind) == offsetof(stillmesh::KeyframeLink, kind) &&
              static_cast<int>(stillmesh::KeyframeLinkKind::kLoop) == SM_LINK_LOOP &&
              stillmesh::kLoopLinksMax == SM_LOOP_LINKS_MAX);

struct sm_trajectory {
    const sm_engine* engine = nullptr;
    std::vector<stillmesh::KeyframePose> keyframes;
    std::vector<stillmesh::KeyframeNow> now;
    stillmesh::FinalTrajectory final;
    std::size_t frames = 0;
};

namespace stillmesh::c_api {
namespace {

[[nodiscard]] TrajectoryPose pose_of(const RigidTransform& transform, std::int64_t time_ns) {
    TrajectoryPose out;
    out.time_ns = time_ns;
    std::copy_n(transform.translation_m, 3, out.t.begin());
    std::copy_n(transform.rotation_xyzw, 4, out.q.begin());
    return out;
}

void update(sm_trajectory& trajectory) {
    const std::uint32_t count = trajectory.engine->engine->keyframes(trajectory.keyframes);
    trajectory.now.clear();
    for (std::uint32_t i = 0; i < count; ++i) {
        const KeyframePose& keyframe = trajectory.keyframes[i];
        trajectory.now.push_back({keyframe.id, keyframe.parent_id, pose_of(keyframe.map_from_camera, 0)});
    }
    trajectory.final.update(trajectory.now);
}

#define STILLMESH_SAME(name) out.name = in.name;
#define STILLMESH_OF(part, name) out.part##_##name = in.part.name;

void fill_map(const EngineStatistics& in, sm_statistics& out) noexcept {
    STILLMESH_SAME(keyframes_evicted)
    STILLMESH_SAME(keyframes_redundant)
    STILLMESH_SAME(points_culled)
    STILLMESH_SAME(points_emptied)
    STILLMESH_SAME(points_fused)
    STILLMESH_SAME(points_evicted)
    STILLMESH_SAME(frames)
    STILLMESH_SAME(frames_refused)
    STILLMESH_SAME(keyframes_made)
    STILLMESH_SAME(keyframes_forgotten)
    STILLMESH_SAME(points_forgotten)
    STILLMESH_SAME(frames_lost)
    STILLMESH_SAME(recoveries)
    STILLMESH_SAME(keyframes_refused)
    STILLMESH_OF(keyframes, size)
    STILLMESH_OF(keyframes, high_water)
    STILLMESH_OF(keyframes, capacity)
    STILLMESH_OF(map_points, size)
    STILLMESH_OF(map_points, high_water)
    STILLMESH_OF(map_points, capacity)
    STILLMESH_OF(keyframe_queue, size)
    STILLMESH_OF(keyframe_queue, high_water)
    STILLMESH_OF(keyframe_queue, capacity)
    STILLMESH_SAME(arena_used_bytes)
}
void fill_work(const EngineStatistics& in, sm_statistics& out) noexcept {
    STILLMESH_OF(schedule, largest_slice_units)
    STILLMESH_OF(schedule, largest_overdraw_units)
    STILLMESH_OF(schedule, steps)
    STILLMESH_OF(schedule, steps_idle)
    STILLMESH_OF(schedule, slices)
    STILLMESH_OF(schedule, units_granted)
    STILLMESH_OF(schedule, units_spent)
    STILLMESH_OF(schedule, units_lost)
    STILLMESH_OF(mapping, keyframes_inserted)
    STILLMESH_OF(mapping, adjustments)
    STILLMESH_OF(mapping, adjustments_dropped)
    STILLMESH_OF(mapping, adjustment_slices)
    STILLMESH_OF(mapping, adjustment_iterations)
    STILLMESH_OF(mapping, observations_found)
    STILLMESH_OF(mapping, observations_dropped)
}
void fill_loop(const EngineStatistics& in, sm_statistics& out) noexcept {
    STILLMESH_OF(loop, queries)
    STILLMESH_OF(loop, candidates)
    STILLMESH_OF(loop, closed)
    STILLMESH_OF(loop, confirmed)
    STILLMESH_OF(loop, refused_matches)
    STILLMESH_OF(loop, refused_pose)
    STILLMESH_OF(loop, refused_inliers)
    STILLMESH_OF(loop, refused_spread)
    STILLMESH_OF(loop, refused_far)
    STILLMESH_OF(loop, refused_unlikely)
    STILLMESH_OF(loop, refused_gone)
    STILLMESH_OF(loop, dropped)
    STILLMESH_OF(loop, points_fused)
    STILLMESH_OF(loop, observations_found)
    STILLMESH_OF(loop, graph_iterations)
    STILLMESH_OF(loop, adjustments)
    STILLMESH_OF(loop, adjustments_dropped)
    STILLMESH_OF(loop, adjustment_iterations)
    STILLMESH_OF(loop, largest_correction_m)
    STILLMESH_OF(loop, last_correction_m)
    STILLMESH_OF(loop, relocalisations)
    STILLMESH_OF(loop, matched_by_words)
    STILLMESH_OF(loop, relocalisation_queries)
    STILLMESH_OF(loop, relocalisation_candidates)
}
void fill_store(const EngineStatistics& in, sm_statistics& out) noexcept {
    STILLMESH_OF(store, kept)
    STILLMESH_OF(store, known)
    STILLMESH_OF(store, poor)
    STILLMESH_OF(store, refused)
    STILLMESH_OF(store, asked)
    STILLMESH_OF(store, not_found)
    STILLMESH_OF(store, late)
    STILLMESH_OF(store, damaged)
    STILLMESH_OF(store, no_room)
    STILLMESH_OF(store, returned)
    STILLMESH_OF(store, useful)
    STILLMESH_OF(store, points_made)
    STILLMESH_OF(store, points_known)
    STILLMESH_OF(store, corrections)
}

}  // namespace
}  // namespace stillmesh::c_api

using namespace stillmesh;         // NOLINT: the calls stand outside of every namespace
using namespace stillmesh::c_api;  // NOLINT

extern "C" {

sm_status sm_get_pose(const sm_engine* engine, sm_pose* pose) {
    if (engine == nullptr) return SM_INVALID;
    const PoseEstimate& in = engine->engine->pose();
    sm_pose out{};
    out.state = static_cast<std::int32_t>(in.state);
    out.time_ns = in.time_ns;
    out.odom_from_camera = transform_of(in.odom_from_camera);
    out.map_from_odom = transform_of(in.map_from_odom);
    out.map_from_camera = transform_of(map_from_camera(in));
    std::copy_n(in.covariance, 36, out.covariance);
    return write_struct(out, pose);
}

sm_status sm_get_frame_statistics(const sm_engine* engine, sm_frame_statistics* statistics) {
    if (engine == nullptr) return SM_INVALID;
    const FrameStatistics& in = engine->engine->frame_statistics();
    sm_frame_statistics out{};
    out.unsure = static_cast<std::int32_t>(in.unsure);
    out.is_keyframe = in.is_keyframe ? 1 : 0;
    STILLMESH_SAME(frame)
    STILLMESH_SAME(features)
    STILLMESH_SAME(features_with_depth)
    STILLMESH_SAME(matches)
    STILLMESH_SAME(static_matches)
    STILLMESH_SAME(dynamic_matches)
    STILLMESH_SAME(mesh_edges)
    STILLMESH_SAME(mesh_edges_kept)
    STILLMESH_SAME(groups)
    STILLMESH_SAME(pose_iterations)
    STILLMESH_SAME(region_score)
    STILLMESH_SAME(region_margin)
    STILLMESH_SAME(chosen_share)
    STILLMESH_SAME(rival_share)
    STILLMESH_SAME(strayed_since_ns)
    return write_struct(out, statistics);
}

sm_status sm_get_statistics(const sm_engine* engine, sm_statistics* statistics) {
    if (engine == nullptr) return SM_INVALID;
    const EngineStatistics in = engine->engine->statistics();
    sm_statistics out{};
    fill_map(in, out);
    fill_work(in, out);
    fill_loop(in, out);
    fill_store(in, out);
    return write_struct(out, statistics);
}

sm_status sm_get_tracking_view(sm_engine* engine, sm_tracking_view* view) {
    if (engine == nullptr) return SM_INVALID;
    const TrackingView in = engine->engine->tracking_view();
    return write_struct(
        {0, 0, reinterpret_cast<const sm_tracked_feature*>(in.features.data()), in.features.size(),
         reinterpret_cast<const sm_tracked_edge*>(in.edges.data()), in.edges.size(), in.explained_by.data()},
        view);
}

sm_status sm_get_features(const sm_engine* engine, sm_features* features) {
    if (engine == nullptr) return SM_INVALID;
    const FeatureSet& in = engine->engine->features();
    return write_struct({0, 0, reinterpret_cast<const sm_keypoint*>(in.keypoints.begin()),
                         reinterpret_cast<const sm_descriptor*>(in.descriptors.begin()), in.size()},
                        features);
}

std::uint32_t sm_keyframes(const sm_engine* engine, sm_keyframe* out, std::uint32_t count) {
    return engine == nullptr || out == nullptr
               ? 0
               : engine->engine->keyframes({reinterpret_cast<KeyframePose*>(out), count});
}
std::uint32_t sm_keyframe_links(const sm_engine* engine, sm_keyframe_link* out, std::uint32_t count,
                                std::uint32_t of_each) {
    return engine == nullptr || out == nullptr
               ? 0
               : engine->engine->keyframe_links({reinterpret_cast<KeyframeLink*>(out), count}, of_each);
}
sm_status sm_get_depth_image(const sm_engine* engine, std::uint32_t index, sm_depth_image* image) {
    if (engine == nullptr) return SM_INVALID;
    const DepthImage in = engine->engine->depth_image(index);
    return write_struct(
        {0, 0, in.columns, in.rows, in.depth_mm.data(), in.rays.data(), in.frame, transform_of(in.map_from_camera)},
        image);
}
std::uint64_t sm_reference_keyframe(const sm_engine* engine) {
    return engine == nullptr ? SM_NO_KEYFRAME : engine->engine->reference_keyframe();
}
std::uint64_t sm_state_hash(const sm_engine* engine) {
    return engine == nullptr ? 0 : engine->engine->state_hash();
}

std::size_t sm_pose_line(const sm_pose* pose, char* text, std::size_t bytes) {
    sm_pose in;
    std::size_t length = 0;
    if (!read_struct(pose, in)) return 0;
    static_cast<void>(guarded(nullptr, [&] {
        TrajectoryPose out;
        out.time_ns = in.time_ns;
        std::copy_n(in.map_from_camera.translation_m, 3, out.t.begin());
        std::copy_n(in.map_from_camera.rotation_xyzw, 4, out.q.begin());
        const std::string line = pose_line(out);
        length = line.size();
        if (text != nullptr && bytes > 0) std::snprintf(text, bytes, "%s", line.c_str());
        return SM_OK;
    }));
    return length;
}

sm_trajectory* sm_trajectory_create(const sm_engine* engine) {
    sm_trajectory* made = nullptr;
    if (engine == nullptr) return nullptr;
    static_cast<void>(guarded(nullptr, [&] {
        auto trajectory = std::make_unique<sm_trajectory>();
        trajectory->engine = engine;
        trajectory->keyframes.resize(engine->limits.keyframes_max);
        made = trajectory.release();
        return SM_OK;
    }));
    return made;
}
void sm_trajectory_destroy(sm_trajectory* trajectory) {
    delete trajectory;
}

sm_status sm_trajectory_add(sm_trajectory* trajectory) {
    if (trajectory == nullptr) return SM_INVALID;
    const Engine& engine = *trajectory->engine->engine;
    const PoseEstimate& pose = engine.pose();
    if (pose.state == PoseState::kNone) return SM_OK;
    return guarded(nullptr, [&] {
        update(*trajectory);
        trajectory->final.add(pose_of(map_from_camera(pose), pose.time_ns), engine.reference_keyframe());
        const std::int64_t since_ns = engine.frame_statistics().strayed_since_ns;
        if (since_ns != kNoTime) trajectory->final.straighten(since_ns);
        ++trajectory->frames;
        return SM_OK;
    });
}

std::size_t sm_trajectory_known(sm_trajectory* trajectory, std::int64_t* times_ns, sm_transform* poses,
                                std::size_t count) {
    if (trajectory == nullptr) return 0;
    if (times_ns == nullptr || poses == nullptr) return trajectory->frames;
    static_cast<void>(guarded(nullptr, [&] {
        update(*trajectory);
        const Trajectory known = trajectory->final.finish();
        for (std::size_t i = 0; i < std::min(count, known.size()); ++i) {
            times_ns[i] = known[i].time_ns;
            std::copy_n(known[i].t.begin(), 3, poses[i].translation_m);
            std::copy_n(known[i].q.begin(), 4, poses[i].rotation_xyzw);
        }
        return SM_OK;
    }));
    return trajectory->frames;
}

}  // extern "C"
