// The way back into the map, one region at a time:
//   query    the store, with the words of each keyframe once it has some, or of a lost camera's picture
//   check    every number of the region that comes back
//   match    its points with those of the map, by name: what is still there is not made twice
//   insert   room by the usual policy, never from the local map; then in one step keyframe, points and links, where the
//            loops closed meanwhile say that it lies by now
//   words    the keyframe can be recognised again: loop closing, local map and relocalisation do the rest
// A store that never answers, or answers with something else, costs nothing but its regions. Limits: one region on its
// way (limits.store_features_max); kRestMax regions rest. Cost: piece_units_max() a piece.
#pragma once

#include <cstddef>
#include <cstdint>
#include <span>

#include "engine/base/ring.hpp"
#include "engine/paging/paging_state.hpp"
#include "engine/paging/region.hpp"

namespace stillmesh {

class RegionReturn {
public:
    enum class Stage : std::uint8_t { kIdle, kCheck, kNames, kMatch, kRoom, kInsert, kWords };
    static constexpr std::uint32_t kRestMax = 64;

    static constexpr void plan(ArenaPlan& arena, const Limits& limits) noexcept {
        arena.array<std::byte>(region_bytes_max(PagingState::features_max(limits)));
        arena.array<Named>(PagingState::features_max(limits));
        arena.array<std::uint64_t>(limits.keyframes_max + kRestMax);
        Ring<Rest>::plan(arena, kRestMax);
    }
    void create(Arena& arena, PagingState& state) noexcept;
    void reset() noexcept;

    // All return the units they took; 0: there was nothing to do.
    [[nodiscard]] std::uint32_t query() noexcept;
    [[nodiscard]] std::uint32_t receive() noexcept;
    // The next piece of the region at hand.
    [[nodiscard]] std::uint32_t piece() noexcept;
    [[nodiscard]] std::uint32_t piece_units_max() const noexcept;
    // Whether query() would send one, if there were words to send.
    [[nodiscard]] bool may_query() const noexcept {
        return !is_waiting_ && state_->world->clock.frame >= next_return_frame_;
    }
    [[nodiscard]] Stage stage() const noexcept { return stage_; }

private:
    // A point of the region at hand.
    struct Named {
        std::uint64_t name = 0;
        Handle<MapPoint> point;  // of this name in the map
        std::uint32_t index = 0;
    };
    struct Rest {
        std::uint64_t id = 0, until_frame = 0;
    };
    [[nodiscard]] bool is_lost() const noexcept;
    [[nodiscard]] std::uint32_t newest_to_query() const noexcept;
    void send(std::span<const WordWeight> words, std::uint64_t older_than, std::uint32_t score_min) noexcept;
    [[nodiscard]] std::uint32_t check() noexcept;
    [[nodiscard]] std::uint32_t name_points() noexcept;
    [[nodiscard]] std::uint32_t match_points() noexcept;
    [[nodiscard]] std::uint32_t make_room() noexcept;
    [[nodiscard]] std::uint32_t insert() noexcept;
    void insert_feature(Handle<Keyframe> handle, const Named& named, const SE3& correction) noexcept;
    [[nodiscard]] std::uint32_t find_words() noexcept;
    [[nodiscard]] std::span<const std::byte> region() const noexcept { return incoming_.first(incoming_bytes_); }
    void rest(std::uint64_t id) noexcept;
    void drop() noexcept;

    PagingState* state_ = nullptr;  // outlives it
    std::span<std::byte> incoming_;
    std::size_t incoming_bytes_ = 0;
    std::span<Named> named_;
    std::span<std::uint64_t> without_;
    Ring<Rest> resting_;         // regions that do not come again at once
    RegionInfo info_;            // of the region at hand
    Handle<Keyframe> keyframe_;  // that came back
    Stage stage_ = Stage::kIdle;
    std::uint32_t cursor_ = 0;
    std::uint64_t question_ = 0;          // the last number; goes on after a reset, whose answers may still come
    std::uint64_t queried_frame_ = 0;     // when
    std::uint64_t queried_keyframe_ = 0;  // keyframes made before have been queried
    std::uint64_t answered_id_ = 0;
    std::uint64_t next_return_frame_ = 0;
    bool is_waiting_ = false;
};

}  // namespace stillmesh
