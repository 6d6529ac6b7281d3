#include "engine/paging/region_keeper.hpp"

#include <algorithm>

#include "engine/geometry/view_distance.hpp"

namespace stillmesh {

void RegionKeeper::create(Arena& arena, PagingState& state) noexcept {
    state_ = &state;
    outgoing_ = arena.array<std::byte>(region_bytes_max(state.features_max()));
}

std::uint32_t RegionKeeper::keep_units_max() const noexcept {
    const std::uint32_t features = state_->world->limits.features_max;
    const std::uint32_t words = state_->places->is_on() ? state_->places->find_units(features) : 1U;
    return words + 4 * features + PlaceSearch::kNeighbours * features / 32;
}

void RegionKeeper::note_useful() noexcept {
    for (PagingState::Known& k : state_->known) {
        if (!k.has_returned || k.is_useful) continue;
        const Keyframe* const keyframe = state_->world->map.keyframes().find(k.handle);
        if (keyframe == nullptr || keyframe->last_useful_frame <= k.returned_frame) continue;
        k.is_useful = true;
        ++state_->world->statistics.store.useful;
        state_->store->note_use(keyframe->frame);
    }
}

bool RegionKeeper::has_moved(const PagingState::Known& of, const SE3& world_from_camera) const noexcept {
    const SE3 off = of.kept_at.inverse() * world_from_camera;
    const double least_m = state_->world->parameters.loop.correction_min_m;
    return off.translation.squaredNorm() > least_m * least_m || rotation_angle(off.rotation) > least_m;
}

bool RegionKeeper::has_kept_twin(std::uint32_t slot) const noexcept {
    const Pool<Keyframe>& keyframes = state_->world->map.keyframes();
    const StoreParameters& p = state_->world->parameters.store;
    const SE3& here = keyframes.at(slot).world_from_camera;
    for (std::uint32_t other = 0; other < state_->known.size(); ++other) {
        const PagingState::Known& k = state_->known[other];
        if (other == slot || !k.is_stored || keyframes.find(k.handle) == nullptr) continue;
        if (view_distance_m2(keyframes.at(other).world_from_camera, here) <= p.twin_m * p.twin_m) return true;
    }
    return false;
}

std::uint32_t RegionKeeper::keep_next(bool is_closing) noexcept {
    const World& world = *state_->world;
    if (refused_frame_ == world.clock.frame) return 0;  // there may be room after the next frame
    const Pool<Keyframe>& keyframes = world.map.keyframes();
    const std::span<const std::uint8_t> is_local = world.local_map.keyframes();
    const Handle<Keyframe> newest = world.map.recent_keyframe(0);
    std::uint32_t next = keyframes.slots_count();
    for (std::uint32_t slot = 0; slot < keyframes.slots_count(); ++slot) {
        if (!keyframes.is_taken(slot)) continue;
        const PagingState::Known& k = state_->known_of(slot);
        const Keyframe& keyframe = keyframes.at(slot);
        if (k.is_kept && !has_moved(k, keyframe.world_from_camera)) continue;
        if (!is_closing) {
            // Its points are refined as long as it is in view, and its words settle.
            if (is_local[slot] != 0 || slot == newest.slot()) continue;
            if (!state_->places->has(k.handle)) continue;
        }
        if (next < keyframes.slots_count() && keyframe.frame >= keyframes.at(next).frame) continue;
        next = slot;
    }
    return next < keyframes.slots_count() ? keep(next) : 0;
}

std::uint32_t RegionKeeper::keep(std::uint32_t slot) noexcept {
    const World& world = *state_->world;
    PlaceSearch& places = *state_->places;
    StoreStatistics& statistics = state_->world->statistics.store;
    PagingState::Known& k = state_->known_of(slot);
    const Keyframe& keyframe = world.map.keyframes().at(slot);
    std::uint32_t units = 1 + world.limits.keyframes_max / 16;
    const bool is_again = k.is_stored;
    k.kept_at = keyframe.world_from_camera;
    k.is_kept = true;
    if (!is_again && has_kept_twin(slot)) {
        ++statistics.known;
        return units;
    }
    const std::size_t size =
        encode_region(world.map, k.handle, world.parameters.weights.eligible, state_->moment(), outgoing_);
    units += 2 * world.limits.features_max;
    LeavingRegion leaving;
    leaving.body = outgoing_.first(size);
    // What is recognised from half as many matches as make a loop is not recognised from fewer points.
    if (leaving.body.size() <
        region_bytes_max(std::min(world.parameters.loop.inliers_min / 2, state_->features_max()))) {
        ++statistics.poor;
        return units;
    }
    leaving.words = places.has(k.handle) ? places.database().bag(slot) : std::span<const WordWeight>{};
    if (leaving.words.empty()) {  // at the end: it has not been looked up yet
        places.find_words(world.map, k.handle, world.parameters, state_->words);
        leaving.words = state_->words.bag();
        units += places.find_units(world.map.observations(k.handle).size());
    } else {
        leaving.alike_score = state_->least_score(slot, units);
    }
    if (leaving.words.empty()) return units;
    leaving.id = keyframe.frame;
    leaving.time_ns = keyframe.time_ns;
    for (int i = 0; i < 3; ++i) {
        leaving.position_m[i] = static_cast<float>(keyframe.world_from_camera.translation(i));
        leaving.axis[i] = static_cast<float>(keyframe.world_from_camera.rotation(i, 2));
    }
    if (state_->store->keep(leaving) != Status::kOk) {
        ++statistics.refused;
        k.is_kept = false;  // it is tried again, as long as it is in the map
        refused_frame_ = world.clock.frame;
        return units;
    }
    k.is_stored = true;
    ++statistics.kept;
    state_->hash.add(leaving.id);
    return units;
}

}  // namespace stillmesh
