// The way out of the map: a keyframe that is known by its words and no longer part of the local map is given to the
// store while it still has its points, once, unless one that sees the same place was; once more when the map has moved
// it. What makes room in the map afterwards (engine/map/eviction.hpp) takes nothing that is not kept. Limit: one region
// on its way. Cost: keep_units_max() a keyframe.
#pragma once

#include <cstddef>
#include <cstdint>
#include <span>

#include "engine/paging/paging_state.hpp"
#include "engine/paging/region.hpp"

namespace stillmesh {

class RegionKeeper {
public:
    static constexpr void plan(ArenaPlan& arena, const Limits& limits) noexcept {
        arena.array<std::byte>(region_bytes_max(PagingState::features_max(limits)));
    }
    void create(Arena& arena, PagingState& state) noexcept;
    void reset() noexcept { refused_frame_ = kNever; }

    // Keeps the oldest keyframe that waits for it; units, 0: none waits, or the store had no room in this frame.
    // `is_closing`: those of the local map, and those without words, too.
    [[nodiscard]] std::uint32_t keep_next(bool is_closing) noexcept;
    [[nodiscard]] bool was_refused() const noexcept { return refused_frame_ != kNever; }
    void try_again() noexcept { refused_frame_ = kNever; }
    // Tells the store which of the regions that came back were seen by tracking since.
    void note_useful() noexcept;
    [[nodiscard]] std::uint32_t keep_units_max() const noexcept;

private:
    static constexpr std::uint64_t kNever = ~std::uint64_t{0};

    [[nodiscard]] std::uint32_t keep(std::uint32_t slot) noexcept;
    [[nodiscard]] bool has_moved(const PagingState::Known& of, const SE3& world_from_camera) const noexcept;
    [[nodiscard]] bool has_kept_twin(std::uint32_t slot) const noexcept;

    PagingState* state_ = nullptr;  // outlives it
    std::span<std::byte> outgoing_;
    std::uint64_t refused_frame_ = kNever;  // the store had no room then
};

}  // namespace stillmesh
