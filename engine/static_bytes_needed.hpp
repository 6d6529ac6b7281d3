// bytes_needed() at compile time, for a block that is a global array:
//
//   alignas(stillmesh::kArenaAlignment) std::byte block[stillmesh::static_bytes_needed(stillmesh::Limits::pocket())];
//
// Knows the size of everything in the engine, hence brings in the inner headers and Eigen as the engine configures it:
// link stillmesh::static_memory, and include it in a translation unit that does nothing else, where no other Eigen is.
// Equal to bytes_needed() to the byte (tests/engine/static_memory_test.cpp).
#pragma once

#if !defined(EIGEN_DONT_VECTORIZE) || !defined(EIGEN_NO_MALLOC) || !defined(eigen_assert)
#error "Eigen is configured otherwise here than in the engine, where sizes would differ: link stillmesh::static_memory"
#endif

#include <cstddef>

#include "engine/base/arena.hpp"
#include "engine/engine_state.hpp"
#include "engine/limits.hpp"

namespace stillmesh {

// Valid for the same limits as bytes_needed().
[[nodiscard]] constexpr std::size_t static_bytes_needed(const Limits& limits) noexcept {
    ArenaPlan plan;
    plan.array<EngineState>(1);
    World::plan(plan, limits);
    PlaceSearch::plan(plan, limits);
    Relocalisation::plan(plan, limits);
    Tracking::plan(plan, limits);
    Mapping::plan(plan, limits);
    LoopClosing::plan(plan, limits);
    GlobalRefinement::plan(plan, limits);
    if (limits.store_features_max > 0) {
        plan.array<MapPager>(1);
        MapPager::plan(plan, limits);
    }
    return plan.used_bytes();
}

}  // namespace stillmesh
