#include "engine/paging/paging_state.hpp"

#include <algorithm>

namespace stillmesh {

void PagingState::create(Arena& arena, World& shared_world, PlaceSearch& search, MapStore* map_store) noexcept {
    world = &shared_world;
    places = &search;
    store = map_store;
    known = arena.array<Known>(world->limits.keyframes_max);
    words.create(arena, world->limits.features_max);
    corrections.create(arena, kCorrectionsMax);
}

void PagingState::reset() noexcept {
    std::fill(known.begin(), known.end(), Known{});
    words.clear();
    corrections.clear();
    loops_closed = 0;
    hash = StateHash{};
}

PagingState::Known& PagingState::known_of(std::uint32_t slot) const noexcept {
    const Handle<Keyframe> handle = world->map.keyframes().handle_of(slot);
    if (!(known[slot].handle == handle)) {
        known[slot] = Known{};
        known[slot].handle = handle;
    }
    return known[slot];
}

void PagingState::note_correction() noexcept {
    if (world->loops_closed == loops_closed) return;
    loops_closed = world->loops_closed;
    const LoopCorrection& last = world->last_loop;
    if (last.frame_new <= last.frame_old) return;
    ++world->statistics.store.corrections;
    corrections.push_over({last, moment()});
}

SE3 PagingState::correction_since(std::uint64_t left_at, std::uint64_t frame) const noexcept {
    SE3 out;
    for (std::size_t i = 0; i < corrections.size(); ++i) {
        const LoopCorrection& loop = corrections[i].loop;
        if (corrections[i].at <= left_at || frame <= loop.frame_old) continue;
        if (frame >= loop.frame_new) {
            out = loop.world_from_world * out;
        } else {
            const double share =
                static_cast<double>(frame - loop.frame_old) / static_cast<double>(loop.frame_new - loop.frame_old);
            out = se3_exp(se3_log(loop.world_from_world) * share) * out;
        }
        renormalise(out.rotation);
    }
    return out;
}

std::uint32_t PagingState::least_score(std::uint32_t slot, std::uint32_t& units) const noexcept {
    const PlaceSearch::Neighbourhood around = places->neighbourhood(world->map, slot);
    units += around.neighbours * world->limits.features_max / 32;
    return around.score_min;
}

}  // namespace stillmesh
