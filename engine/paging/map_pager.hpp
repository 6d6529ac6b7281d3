// More places than memory (docs/map-store.md): keyframes go to a map store while they still have their points
// (region_keeper.hpp), and come back when their words are seen again (region_return.hpp). First of the background
// tasks, since what it does in a while is bounded. Units: 32 descriptors compared, or what takes as long. No piece
// takes more than piece_units_max(); the result does not depend on how the pieces are cut into slices, as long as
// answers come at the same polls.
#pragma once

#include <cstdint>

#include "engine/outputs.hpp"
#include "engine/paging/paging_state.hpp"
#include "engine/paging/region_keeper.hpp"
#include "engine/paging/region_return.hpp"
#include "engine/schedule/task.hpp"

namespace stillmesh {

class MapPager final : public Task {
public:
    static constexpr std::uint32_t kKeptPerRound = 4;

    // For limits that ask for a store.
    static constexpr void plan(ArenaPlan& arena, const Limits& limits) noexcept {
        PagingState::plan(arena, limits);
        RegionKeeper::plan(arena, limits);
        RegionReturn::plan(arena, limits);
    }
    // `store` may be nullptr: nothing happens.
    void create(Arena& arena, World& world, PlaceSearch& places, MapStore* store) noexcept;
    void reset() noexcept;

    [[nodiscard]] bool is_on() const noexcept { return state_.store != nullptr && state_.places->is_on(); }
    // What a store says is not believed beyond half of the names and times that a map can hold: the rest is for what
    // comes.
    [[nodiscard]] StoreContent content() const noexcept;
    [[nodiscard]] Progress step(WorkBudget& budget) noexcept override;
    // Everything that has not been kept yet; kIdle: nothing is left.
    [[nodiscard]] Progress keep_all(WorkBudget& budget) noexcept;
    [[nodiscard]] std::uint32_t piece_units_max() const noexcept { return piece_units_max_; }
    [[nodiscard]] std::uint64_t state_hash() const noexcept;

private:
    // New work is taken up once a frame, with the first call after it, whatever the other tasks do in the meantime:
    // otherwise the cutting of their slices would decide when.
    enum class Round : std::uint8_t { kReceive, kKeep, kQuery, kDone };

    // One piece; 0: there is nothing to do.
    [[nodiscard]] std::uint32_t piece() noexcept;

    PagingState state_;
    RegionKeeper keeper_;
    RegionReturn returns_;
    Round round_ = Round::kDone;
    std::uint64_t round_frame_ = ~std::uint64_t{0};
    std::uint32_t kept_in_round_ = 0;
    std::uint32_t piece_units_max_ = 0;
};

}  // namespace stillmesh
