#include "engine/mapping/mapping.hpp"

#include <algorithm>

#include "engine/map/eviction.hpp"

namespace stillmesh {
namespace {

constexpr std::uint32_t kSpareKeyframes = 64;  // one of so many is kept free ahead of need, and at least one
constexpr std::uint32_t kCullChunk = 1024;     // slots in a piece

}  // namespace

void Mapping::create(Arena& arena, World& world) noexcept {
    world_ = &world;
    const Limits& limits = world.limits;
    window_.create(arena, world);
    fusion_.create(arena, world);
    // The longest pieces: the commit, which looks at every point, and the choice of the window.
    const std::uint32_t commit = limits.map_points_max / 16 + limits.features_max + 4 * limits.keyframes_max;
    piece_units_max_ = std::max({commit, 2 * limits.features_max, LocalAdjustment::kPieceUnitsMax});
    reset();
}

void Mapping::reset() noexcept {
    window_.cancel();
    fusion_.forget_target();
    stage_ = Stage::kIdle;  // which the next keyframe leaves, and brings all else
}

void Mapping::enter(Stage stage) noexcept {
    stage_ = stage;
    cursor_ = 0;
    fusion_.forget_target();
}

bool Mapping::take() noexcept {
    Ring<Handle<Keyframe>>& queue = world_->keyframe_queue;
    while (!queue.is_empty()) {
        keyframe_ = queue[0];
        queue.pop();
        if (world_->map.keyframes().find(keyframe_) == nullptr) continue;  // evicted while it waited
        ++world_->statistics.mapping.keyframes_inserted;
        enter(Stage::kCull);
        return true;
    }
    return false;
}

Progress Mapping::step(WorkBudget& budget) noexcept {
    heed_correction();
    if (stage_ == Stage::kIdle && !take()) return Progress::kIdle;
    while (!budget.is_spent()) {
        // Only tracking evicts besides the last stages, and never the newest; but the queue may have been long.
        const bool needs_keyframe = stage_ != Stage::kIdle && stage_ < Stage::kRedundant;
        if (needs_keyframe && world_->map.keyframes().find(keyframe_) == nullptr) {
            drop_adjustment();
            enter(Stage::kEvict);
        }
        switch (stage_) {
            case Stage::kIdle: return Progress::kDone;
            case Stage::kCull: budget.spend(cull()); break;
            case Stage::kChoose:
                budget.spend(find_neighbours());
                budget.spend(window_.choose(keyframe_, {neighbours_, neighbour_count_}));
                enter(window_.is_chosen() ? Stage::kCollect : Stage::kRedundant);
                break;
            case Stage::kCollect:
                budget.spend(window_.collect());
                if (!window_.is_collected()) break;
                ++world_->statistics.mapping.adjustments;
                enter(Stage::kAdjust);
                break;
            case Stage::kAdjust:
                ++world_->statistics.mapping.adjustment_slices;
                if (window_.adjust(budget) != Progress::kWorking) enter(Stage::kCommit);
                break;
            case Stage::kCommit:
                budget.spend(window_.commit());
                enter(Stage::kRedundant);
                break;
            case Stage::kRedundant: budget.spend(drop_redundant()); break;
            case Stage::kEvict: budget.spend(evict()); break;
        }
    }
    return stage_ == Stage::kIdle ? Progress::kDone : Progress::kWorking;
}

void Mapping::drop_adjustment() noexcept {
    if (stage_ == Stage::kAdjust || stage_ == Stage::kCommit) ++world_->statistics.mapping.adjustments_dropped;
    window_.cancel();
}

// The whole map moved since the window was chosen: what is known of it is out of date.
void Mapping::heed_correction() noexcept {
    if (corrections_seen_ == world_->corrections) return;
    corrections_seen_ = world_->corrections;
    if (stage_ != Stage::kCollect && stage_ != Stage::kAdjust && stage_ != Stage::kCommit) return;
    drop_adjustment();
    enter(Stage::kRedundant);
}

// --- points ----------------------------------------------------------------------------------------------------------

std::uint32_t Mapping::cull() noexcept {
    cursor_ = cull_points(world_->map, world_->clock.frame, cursor_, kCullChunk);
    if (cursor_ == 0) enter(Stage::kChoose);
    return kCullChunk / 16;
}

std::uint32_t Mapping::find_neighbours() noexcept {
    std::uint32_t best[kNeighboursMax] = {};
    neighbour_count_ = world_->map.best_covisible(keyframe_.slot(), best, world_->parameters.map.shared_min);
    for (std::uint32_t i = 0; i < neighbour_count_; ++i) neighbours_[i] = world_->map.keyframes().handle_of(best[i]);
    return 2;
}

// --- room ------------------------------------------------------------------------------------------------------------

std::uint32_t Mapping::drop_redundant() noexcept {
    // One neighbour a piece; the newest keyframes have not had the time to prove themselves. While half the pool is
    // free all stay: more observations of a place make it surer (measured, docs/mapping.md).
    const Pool<Keyframe>& pool = world_->map.keyframes();
    if (cursor_ >= neighbour_count_ || 2 * pool.size() <= pool.capacity()) {
        enter(Stage::kEvict);
        return 1;
    }
    const Handle<Keyframe> handle = neighbours_[cursor_++];
    const Keyframe* const keyframe = world_->map.keyframes().find(handle);
    if (keyframe == nullptr || keyframe->parent.is_null()) return 1;
    if (handle == world_->map.recent_keyframe(0) || handle == world_->map.recent_keyframe(1)) return 1;
    if (is_redundant(world_->map, handle)) release_redundant(world_->map, handle);
    return 1 + world_->limits.features_max / 2;
}

std::uint32_t Mapping::evict() noexcept {
    const Pool<Keyframe>& keyframes = world_->map.keyframes();
    const Pool<MapPoint>& points = world_->map.points();
    const std::size_t keyframes_spare = std::max<std::size_t>(1, keyframes.capacity() / kSpareKeyframes);
    if (keyframes.capacity() - keyframes.size() < keyframes_spare && cursor_ < keyframes_spare) {
        ++cursor_;
        if (evict_keyframe(world_->map, world_->local_map.keyframes())) {
            const std::uint32_t compared = std::min(world_->limits.keyframes_max, kCrowdedCandidates);
            return 1 + world_->limits.features_max / 2 + 2 * world_->limits.keyframes_max + compared * compared / 4;
        }
    }
    const std::size_t points_spare = std::min<std::size_t>(world_->limits.features_max, points.capacity() / 6);
    const std::size_t free = points.capacity() - points.size();
    stage_ = Stage::kIdle;
    if (free >= points_spare) return 1;
    static_cast<void>(make_room_for_points(world_->map, static_cast<std::uint32_t>(points_spare - free),
                                           world_->clock.frame, world_->local_map.spared()));
    return world_->limits.map_points_max / 16;
}

}  // namespace stillmesh
