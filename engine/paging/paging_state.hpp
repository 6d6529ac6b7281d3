// What the two halves of paging share: what is known of each keyframe in the map, the loops that what is outside has to
// follow when it comes back, and what was done. Limits: kCorrectionsMax loops are remembered. Cost: one look at each.
#pragma once

#include <cstdint>
#include <span>

#include "engine/base/hash.hpp"
#include "engine/base/ring.hpp"
#include "engine/outputs.hpp"
#include "engine/paging/map_store.hpp"
#include "engine/recognition/place_search.hpp"
#include "engine/world/world.hpp"

namespace stillmesh {

struct PagingState {
    static constexpr std::uint32_t kCorrectionsMax = 32;

    // Of the keyframe in a slot.
    struct Known {
        Handle<Keyframe> handle;
        SE3 kept_at;  // where it lay when it was kept, or came back
        std::uint64_t returned_frame = 0;
        bool is_stored = false;  // and its region is in the store
        bool is_kept = false;    // or need not be
        bool has_returned = false;
        bool is_useful = false;  // since it returned
    };
    struct Correction {
        LoopCorrection loop;
        std::uint64_t at = 0;  // moment()
    };

    static constexpr void plan(ArenaPlan& arena, const Limits& limits) noexcept {
        arena.array<Known>(limits.keyframes_max);
        FrameWords::plan(arena, limits.features_max);
        Ring<Correction>::plan(arena, kCorrectionsMax);
    }
    [[nodiscard]] static constexpr std::uint32_t features_max(const Limits& limits) noexcept {
        return limits.store_features_max < limits.features_max ? limits.store_features_max : limits.features_max;
    }
    void create(Arena& arena, World& shared_world, PlaceSearch& search, MapStore* map_store) noexcept;
    void reset() noexcept;

    [[nodiscard]] std::uint32_t features_max() const noexcept { return features_max(world->limits); }
    [[nodiscard]] Known& known_of(std::uint32_t slot) const noexcept;
    // Grows with every frame and every loop, and from one run in a store to the next: what left before a loop follows
    // it.
    [[nodiscard]] std::uint64_t moment() const noexcept {
        return world->clock.frame << 16U | (world->statistics.store.corrections & 0xffffU);
    }
    // To be called before anything else is done with the map as it is now.
    void note_correction() noexcept;
    // Where what left the map at `left_at` (moment), made in `frame`, lies now: a loop moved what was made on its way
    // by its share of it.
    [[nodiscard]] SE3 correction_since(std::uint64_t left_at, std::uint64_t frame) const noexcept;
    // The least score among those that share most with a keyframe: what "alike" means there; 0: there are none. Adds
    // what it took.
    [[nodiscard]] std::uint32_t least_score(std::uint32_t slot, std::uint32_t& units) const noexcept;

    World* world = nullptr;  // this and the others outlive it
    PlaceSearch* places = nullptr;
    MapStore* store = nullptr;  // none: nothing happens
    std::span<Known> known;     // by keyframe slot
    FrameWords words;           // of the keyframe at hand
    Ring<Correction> corrections;
    std::uint64_t loops_closed = 0;  // that were noted
    StateHash hash;                  // of regions kept and returned, in this order
};

}  // namespace stillmesh
