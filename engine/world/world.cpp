#include "engine/world/world.hpp"

#include <algorithm>

#include "engine/geometry/camera.hpp"
#include "engine/map/map_readout.hpp"
#include "engine/static_region/paper_choice.hpp"

namespace stillmesh {
namespace {

void compose(const SE3& correction, bool& is_any, SE3& all) noexcept {
    all = is_any ? correction * all : correction;
    if (is_any) renormalise(all.rotation);
    is_any = true;
}

}  // namespace

void World::create(Arena& arena, const Limits& limits_max, const Parameters& all, const CameraModel& model) noexcept {
    limits = limits_max;
    parameters = all.region.is_paper() ? as_in_paper(all) : all;
    camera = model;
    pixel_noise.create(parameters, model);
    map.create(arena, limits_max, parameters.map);
    depth_images.create(arena, limits_max, model);
    local_map.create(arena, limits_max, parameters.local_map, view_cosine(model));
    map_correction.create(arena, limits_max);
    keyframe_queue.create(arena, kKeyframeQueueMax);
    noise = {parameters.noise.pixel_start, parameters.noise.depth_start};
}

void World::reset() noexcept {
    map.reset();
    depth_images.reset();
    local_map.reset();
    keyframe_queue.clear();
    clock = Clock{};
    noise = {parameters.noise.pixel_start, parameters.noise.depth_start};
    pose = PoseEstimate{};
    is_frozen = false;
    camera_move = CameraMove{};
    corrections = 0;
    loops_closed = 0;
    last_loop = LoopCorrection{};
    statistics = EngineStatistics{};
}

EngineStatistics World::all_statistics() const noexcept {
    EngineStatistics out = statistics;
    out.frames = clock.frame - clock.first_frame;
    out.keyframe_queue.size = static_cast<std::uint32_t>(keyframe_queue.size());
    out.keyframe_queue.capacity = kKeyframeQueueMax;
    fill_map_statistics(map, out);
    return out;
}

bool World::queue_keyframe(Handle<Keyframe> keyframe) noexcept {
    const bool is_queued = keyframe_queue.push(keyframe);
    std::uint32_t& high_water = statistics.keyframe_queue.high_water;
    high_water = std::max(high_water, static_cast<std::uint32_t>(keyframe_queue.size()));
    return is_queued;
}

void World::move_camera(const SE3& correction) noexcept {
    compose(correction, camera_move.is_any, camera_move.correction);
}

void World::move_everything(const SE3& correction) noexcept {
    move_camera(correction);
    compose(correction, camera_move.has_jumped, camera_move.jump);
    ++corrections;
    local_map.invalidate();
}

void World::follow_correction() noexcept {
    const SE3* const of_camera = map_correction.of_newest(map);
    move_everything(of_camera != nullptr ? *of_camera : SE3{});
}

}  // namespace stillmesh
