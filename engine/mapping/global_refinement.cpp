#include "engine/mapping/global_refinement.hpp"

#include <algorithm>

namespace stillmesh {

void GlobalRefinement::create(Arena& arena, World& world) noexcept {
    world_ = &world;
    const Limits& limits = world.limits;
    adjustment_.create(arena, sizes(limits));
    keyframes_.create(arena, sizes(limits).keyframes_max);
    index_ = arena.array<std::uint32_t>(sizes(limits).points_max);
    points_ = arena.array<Handle<MapPoint>>(sizes(limits).points_max);
    // The longest pieces: the commit, which looks at every point; a keyframe's features; the adjustment's own.
    piece_units_max_ = std::max({limits.map_points_max / 16 + 8 * limits.keyframes_max + 1, limits.features_max,
                                 adjustment_.piece_units_max()});
    reset();
}

void GlobalRefinement::reset() noexcept {
    adjustment_.begin();
    loops_seen_ = 0;
    stage_ = Stage::kIdle;
}

void GlobalRefinement::enter(Stage stage) noexcept {
    stage_ = stage;
    cursor_ = 0;
}

// A loop has moved the keyframes of the copy.
void GlobalRefinement::heed_loops() noexcept {
    if (loops_seen_ == world_->loops_closed) return;
    loops_seen_ = world_->loops_closed;
    if (stage_ > Stage::kKeyframes) ++world_->statistics.loop.adjustments_dropped;
    adjustment_.begin();
    enter(world_->parameters.loop.is_adjusting && !index_.empty() ? Stage::kKeyframes : Stage::kIdle);
}

Progress GlobalRefinement::step(WorkBudget& budget) noexcept {
    heed_loops();
    if (stage_ == Stage::kIdle) return Progress::kIdle;
    while (!budget.is_spent()) {
        switch (stage_) {
            case Stage::kIdle: return Progress::kDone;
            case Stage::kKeyframes: budget.spend(add_keyframes()); break;
            case Stage::kPoints: budget.spend(add_points()); break;
            case Stage::kReserve: budget.spend(add_observations(true)); break;
            case Stage::kObservations: budget.spend(add_observations(false)); break;
            case Stage::kAdjust:
                if (adjustment_.step(budget) != Progress::kWorking) enter(Stage::kCommit);
                break;
            case Stage::kCommit: budget.spend(commit()); break;
        }
    }
    return stage_ == Stage::kIdle ? Progress::kDone : Progress::kWorking;
}

std::uint32_t GlobalRefinement::add_keyframes() noexcept {
    const Pool<Keyframe>& keyframes = world_->map.keyframes();
    adjustment_.begin();
    keyframes_.clear();
    std::fill(index_.begin(), index_.end(), 0U);
    for (std::uint32_t slot = 0; slot < keyframes.slots_count(); ++slot) {
        if (!keyframes.is_taken(slot)) continue;
        const Keyframe& keyframe = keyframes.at(slot);
        const auto added = adjustment_.add_keyframe(keyframe.world_from_camera, keyframe.parent.is_null());
        STILLMESH_CHECK(added.is_ok());
        keyframes_.add(world_->map, slot, added.value());
    }
    since_frame_ = world_->clock.frame;
    ++world_->statistics.loop.adjustments;
    enter(Stage::kPoints);
    return world_->limits.keyframes_max + world_->limits.map_points_max / 64;
}

std::uint32_t GlobalRefinement::add_points() noexcept {
    const Pool<MapPoint>& points = world_->map.points();
    for (std::uint32_t n = 0; n < 512 && cursor_ < points.slots_count(); ++n, ++cursor_) {
        if (!points.is_taken(cursor_) || points.at(cursor_).observers < 2) continue;
        if (!is_static(&points.at(cursor_), world_->parameters.weights.eligible)) continue;
        const auto added = adjustment_.add_point(vector_of(points.at(cursor_).world));
        STILLMESH_CHECK(added.is_ok());
        index_[cursor_] = added.value() + 1;
        points_[added.value()] = points.handle_of(cursor_);
    }
    if (cursor_ == points.slots_count()) enter(Stage::kReserve);
    return 128;
}

// One keyframe a piece, twice: first how many observations each point has, then the observations.
std::uint32_t GlobalRefinement::add_observations(bool is_reserving) noexcept {
    const Pool<Keyframe>& keyframes = world_->map.keyframes();
    const std::uint32_t slots = keyframes.slots_count();
    while (cursor_ < slots && keyframes.find(keyframes_.handle(cursor_)) == nullptr) ++cursor_;
    if (cursor_ == slots) {
        if (is_reserving) {
            adjustment_.fill();
        } else {
            adjustment_.start(GlobalOptions{});
        }
        enter(is_reserving ? Stage::kObservations : Stage::kAdjust);
        return 1 + slots / 32;
    }
    const std::uint32_t slot = cursor_++;
    const Handle<Keyframe> handle = keyframes_.handle(slot);
    if (is_reserving) static_cast<void>(world_->map.carry_observations(handle, world_->camera.height));
    for (const Observation& o : world_->map.observations(handle)) add_observation(slot, o, is_reserving);
    return 1 + world_->limits.features_max / 4;
}

void GlobalRefinement::add_observation(std::uint32_t keyframe_slot, const Observation& o, bool is_reserving) noexcept {
    if (world_->map.points().find(o.point) == nullptr || index_[o.point.slot()] == 0) return;
    const std::uint32_t index = index_[o.point.slot()] - 1;
    if (!(points_[index] == o.point)) return;
    if (is_reserving) {
        static_cast<void>(adjustment_.reserve(index));  // full: the rest has no say
        return;
    }
    AdjustmentObservation in;
    in.keyframe = keyframes_.number(keyframe_slot);
    in.point = index;
    in.x = static_cast<double>(o.normalised_x);
    in.y = static_cast<double>(o.normalised_y);
    in.var_pixel = world_->pixel_noise.var(o.level) * world_->noise.pixel / o.averaged;
    if (o.var_z >= 0) {
        in.z_m = static_cast<double>(o.z_m);
        in.var_z = static_cast<double>(o.var_z) * world_->noise.depth / o.averaged;
    }
    static_cast<void>(adjustment_.add_observation(in));  // more than were reserved: linked meanwhile
}

bool GlobalRefinement::adjusted_place(std::uint32_t slot, const MapPoint& point, Vector3& world) const noexcept {
    if (index_[slot] == 0) return false;
    const std::uint32_t index = index_[slot] - 1;
    // What tracking has followed since knows better where it is beside its keyframe.
    if (!(points_[index] == world_->map.points().handle_of(slot)) || point.is_suspect ||
        !adjustment_.is_point_used(index) || point.last_seen_frame > since_frame_) {
        return false;
    }
    world = adjustment_.point(index);
    return true;
}

std::uint32_t GlobalRefinement::commit() noexcept {
    const GlobalSummary& summary = adjustment_.summary();
    world_->statistics.loop.adjustment_iterations += summary.iterations;
    if (summary.steps_accepted > 0) {
        keyframes_.move(world_->map, world_->map_correction, adjustment_);
        world_->map_correction.move_points(world_->map,
                                           [this](std::uint32_t slot, const MapPoint& point, Vector3& world) {
                                               return adjusted_place(slot, point, world);
                                           });
        world_->follow_correction();
    }
    adjustment_.begin();
    enter(Stage::kIdle);
    return world_->limits.map_points_max / 16 + 8 * world_->limits.keyframes_max;
}

}  // namespace stillmesh
