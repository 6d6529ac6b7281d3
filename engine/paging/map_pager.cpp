#include "engine/paging/map_pager.hpp"

#include <algorithm>

#include "engine/record/map_checks.hpp"

namespace stillmesh {

void MapPager::create(Arena& arena, World& world, PlaceSearch& places, MapStore* store) noexcept {
    state_.create(arena, world, places, store);
    keeper_.create(arena, state_);
    returns_.create(arena, state_);
    piece_units_max_ = std::max(keeper_.keep_units_max() + world.limits.keyframes_max, returns_.piece_units_max());
    reset();
}

void MapPager::reset() noexcept {
    state_.reset();
    keeper_.reset();
    returns_.reset();
    round_frame_ = ~std::uint64_t{0};  // the next step begins a round
}

StoreContent MapPager::content() const noexcept {
    StoreContent out = state_.store->content();
    out.ids_end = std::min(out.ids_end, map_checks::kFramesMax / 2);
    out.time_ns = std::clamp(out.time_ns, std::int64_t{0}, map_checks::kTimeMax_ns / 2);
    return out;
}

Progress MapPager::step(WorkBudget& budget) noexcept {
    if (!is_on() || state_.world->is_frozen) return Progress::kIdle;
    if (round_frame_ != state_.world->clock.frame) {
        round_frame_ = state_.world->clock.frame;
        round_ = Round::kReceive;
        kept_in_round_ = 0;
        state_.note_correction();
    }
    while (!budget.is_spent()) {
        const std::uint32_t units = piece();
        if (units == 0) return budget.units_spent() == 0 ? Progress::kIdle : Progress::kDone;
        budget.spend(units);
    }
    return Progress::kWorking;
}

Progress MapPager::keep_all(WorkBudget& budget) noexcept {
    if (!is_on() || state_.world->is_frozen) return Progress::kIdle;
    while (!budget.is_spent()) {
        keeper_.try_again();
        const std::uint32_t units = keeper_.keep_next(true);
        if (units == 0) return Progress::kIdle;
        budget.spend(units);
        if (keeper_.was_refused()) return Progress::kWorking;
    }
    return Progress::kWorking;
}

std::uint32_t MapPager::piece() noexcept {
    if (returns_.stage() != RegionReturn::Stage::kIdle) return returns_.piece();
    if (round_ == Round::kReceive) {
        round_ = Round::kKeep;
        if (const std::uint32_t units = returns_.receive(); units > 0) return units;
    }
    if (round_ == Round::kKeep) {
        if (kept_in_round_++ < kKeptPerRound) {
            if (const std::uint32_t units = keeper_.keep_next(false); units > 0) return units;
        }
        round_ = Round::kQuery;
    }
    if (round_ == Round::kDone) return 0;
    round_ = Round::kDone;
    if (returns_.may_query()) keeper_.note_useful();
    return returns_.query();
}

std::uint64_t MapPager::state_hash() const noexcept {
    StateHash hash = state_.hash;
    hash.add(state_.world->statistics.store.asked);
    hash.add(state_.world->statistics.store.kept);
    hash.add(state_.world->statistics.store.refused);
    hash.add(state_.world->statistics.store.returned);
    hash.add(state_.world->statistics.store.corrections);
    hash.add(static_cast<std::uint32_t>(returns_.stage()));
    return hash.value();
}

}  // namespace stillmesh
