// More places than memory (docs/map-store.md): keyframes go to a map store while they still have their points, and come
// back when their words are seen again. First of the background tasks, since what it does in a while is bounded:
//   keep     a keyframe that is known by its words and no longer part of the local map is given to the store, once,
//            unless one that sees the same place was; once more when the map has moved it. Who makes room in the map
//            afterwards (engine/map/eviction.hpp) takes nothing that is not kept.
//   ask      with the words of each keyframe once it has some, or of a lost camera's picture; one question at a time
//   check    every number of the region that comes back
//   match    its points with those of the map, by name: what is still there is not made twice
//   insert   room by the usual policy, never from the local map; then in one step keyframe, points and links, where the
//            loops closed meanwhile say that it lies by now: a loop moved what was made on its way by its share
//   words    the keyframe can be recognised again: loop closing, local map and relocalisation do the rest
// A store that never answers, or answers with something else, costs nothing but its regions.
// Limits: one region on its way out and one on its way in (limits.store_features_max); kCorrectionsMax loops are
// remembered, kRestMax regions rest. Units: 32 descriptors compared, or what takes as long. No piece takes more than
// piece_units_max(); the result does not depend on how the pieces are cut into slices, as long as answers come at the
// same polls.
#pragma once

#include <cstdint>
#include <span>

#include "engine/base/ring.hpp"
#include "engine/configuration.hpp"
#include "engine/outputs.hpp"
#include "engine/paging/map_store.hpp"
#include "engine/paging/region.hpp"
#include "engine/recognition/place_search.hpp"
#include "engine/schedule/task.hpp"
#include "engine/world/world.hpp"

namespace stillmesh {

class MapPager final : public Task {
public:
    enum class Stage : std::uint8_t { kIdle, kCheck, kNames, kMatch, kRoom, kInsert, kWords };
    static constexpr std::uint32_t kCorrectionsMax = 32;
    static constexpr std::uint32_t kRestMax = 64;
    static constexpr std::uint32_t kKeptPerRound = 4;

    // For limits that ask for a store.
    static constexpr void plan(ArenaPlan& arena, const Limits& limits) noexcept {
        arena.array<std::byte>(region_bytes_max(features_max(limits)));
        arena.array<std::byte>(region_bytes_max(features_max(limits)));
        arena.array<Named>(features_max(limits));
        arena.array<Known>(limits.keyframes_max);
        arena.array<std::uint64_t>(limits.keyframes_max + kRestMax);
        FrameWords::plan(arena, limits.features_max);
        Ring<Rest>::plan(arena, kRestMax);
        Ring<Correction>::plan(arena, kCorrectionsMax);
    }
    // `store` may be nullptr: nothing happens.
    void create(Arena& arena, World& world, PlaceSearch& places, MapStore* store) noexcept;
    void reset() noexcept;

    [[nodiscard]] bool is_on() const noexcept { return store_ != nullptr && places_->is_on(); }
    [[nodiscard]] StoreContent content() const noexcept { return store_->content(); }
    [[nodiscard]] Progress step(WorkBudget& budget) noexcept override;
    // Everything that has not been kept yet; kIdle: nothing is left.
    [[nodiscard]] Progress keep_all(WorkBudget& budget) noexcept;
    [[nodiscard]] std::uint32_t piece_units_max() const noexcept { return piece_units_max_; }
    void fill(EngineStatistics& statistics) const noexcept { statistics.store = statistics_; }
    [[nodiscard]] std::uint64_t state_hash() const noexcept;
    [[nodiscard]] Stage stage() const noexcept { return stage_; }

private:
    // What is known of the keyframe in a slot.
    struct Known {
        Handle<Keyframe> handle;
        SE3 kept_at;  // where it lay when it was kept, or came back
        std::uint64_t returned_frame = 0;
        bool is_stored = false;  // and its region is in the store
        bool is_kept = false;    // or need not be
        bool has_returned = false;
        bool is_useful = false;  // since it returned
    };
    // A point of the region at hand.
    struct Named {
        std::uint64_t name = 0;
        Handle<MapPoint> point;  // of this name in the map
        std::uint32_t index = 0;
    };
    struct Correction {
        LoopCorrection loop;
        std::uint64_t at = 0;  // moment()
    };
    // New work is taken up once a frame, with the first call after it, whatever the other tasks do in the meantime:
    // otherwise the cutting of their slices would decide when.
    enum class Round : std::uint8_t { kReceive, kKeep, kAsk, kDone };
    struct Rest {
        std::uint64_t id = 0, until_frame = 0;
    };

    [[nodiscard]] static constexpr std::uint32_t features_max(const Limits& limits) noexcept {
        return limits.store_features_max < limits.features_max ? limits.store_features_max : limits.features_max;
    }
    // One piece; 0: there is nothing to do.
    [[nodiscard]] std::uint32_t piece() noexcept;
    // Grows with every frame and every loop, and from one run in a store to the next: what left before a loop follows
    // it.
    [[nodiscard]] std::uint64_t moment() const noexcept {
        return world_->clock.frame << 16U | (statistics_.corrections & 0xffffU);
    }
    void note_correction() noexcept;
    void note_useful() noexcept;
    [[nodiscard]] Known& known(std::uint32_t slot) noexcept;
    // --- out
    [[nodiscard]] std::uint32_t keep_next(bool is_closing) noexcept;
    [[nodiscard]] std::uint32_t keep(std::uint32_t slot) noexcept;
    [[nodiscard]] bool has_moved(const Known& of, const SE3& world_from_camera) const noexcept;
    [[nodiscard]] bool has_kept_twin(std::uint32_t slot) const noexcept;
    [[nodiscard]] std::uint32_t least_score(std::uint32_t slot, std::uint32_t& units) const noexcept;
    // --- in
    [[nodiscard]] bool is_lost() const noexcept;
    [[nodiscard]] std::uint32_t ask() noexcept;
    void put(std::span<const WordWeight> words, std::uint64_t older_than, std::uint32_t score_min) noexcept;
    [[nodiscard]] std::uint32_t receive() noexcept;
    [[nodiscard]] std::uint32_t check() noexcept;
    [[nodiscard]] std::uint32_t name_points() noexcept;
    [[nodiscard]] std::uint32_t match_points() noexcept;
    [[nodiscard]] std::uint32_t make_room() noexcept;
    [[nodiscard]] std::uint32_t insert() noexcept;
    [[nodiscard]] std::uint32_t find_words() noexcept;
    [[nodiscard]] SE3 correction_since(std::uint64_t left_at, std::uint64_t frame) const noexcept;
    [[nodiscard]] std::span<const std::byte> region() const noexcept { return incoming_.first(incoming_bytes_); }
    void drop() noexcept;

    World* world_ = nullptr;  // this and the others outlive it
    PlaceSearch* places_ = nullptr;
    MapStore* store_ = nullptr;
    std::span<std::byte> outgoing_, incoming_;
    std::size_t incoming_bytes_ = 0;
    std::span<Named> named_;
    std::span<Known> known_;  // by keyframe slot
    std::span<std::uint64_t> without_;
    FrameWords words_;
    Ring<Rest> resting_;
    Ring<Correction> corrections_;    // the last of them
    std::uint64_t loops_closed_ = 0;  // that were noted
    RegionInfo info_;                 // of the region at hand
    Handle<Keyframe> keyframe_;       // that came back
    Stage stage_ = Stage::kIdle;
    std::uint32_t cursor_ = 0;
    std::uint64_t question_ = 0;        // the last number
    std::uint64_t asked_frame_ = 0;     // when
    std::uint64_t asked_keyframe_ = 0;  // keyframes made before have been asked about
    std::uint64_t answered_id_ = 0;
    std::uint64_t next_return_frame_ = 0;
    std::uint64_t refused_frame_ = ~std::uint64_t{0};  // the store had no room then
    bool is_waiting_ = false;
    Round round_ = Round::kDone;
    std::uint64_t round_frame_ = ~std::uint64_t{0};
    std::uint32_t kept_in_round_ = 0;
    std::uint32_t piece_units_max_ = 0;
    StateHash hash_;
    StoreStatistics statistics_;
};

}  // namespace stillmesh
