// An extractor with its memory, for tests and benches.
#pragma once

#include <cstddef>
#include <memory>
#include <new>

#include "engine/features/orb_extractor.hpp"

namespace stillmesh::testing {

struct Rig {
    explicit Rig(const Limits& limits, const Kernels& kernels, OrbOptions options = {}) {
        ArenaPlan arena_plan;
        OrbExtractor::plan(arena_plan, limits);
        FeatureSet::plan(arena_plan, limits.features_max);
        planned_bytes = arena_plan.used_bytes();
        block.reset(new (std::align_val_t(kArenaAlignment)) std::byte[planned_bytes]);
        Arena arena({block.get(), planned_bytes});
        if (options.features_max > limits.features_max) options.features_max = limits.features_max;
        if (options.levels > limits.pyramid_levels_max) options.levels = limits.pyramid_levels_max;
        extractor.create(arena, limits, options, kernels);
        features.create(arena, limits.features_max);
        used_bytes = arena.used_bytes();
    }
    struct Free {
        void operator()(std::byte* bytes) const { ::operator delete[](bytes, std::align_val_t(kArenaAlignment)); }
    };
    std::size_t planned_bytes = 0;
    std::size_t used_bytes = 0;
    std::unique_ptr<std::byte[], Free> block;
    OrbExtractor extractor;
    FeatureSet features;
};

}  // namespace stillmesh::testing
