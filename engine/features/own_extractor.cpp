#include "engine/features/own_extractor.hpp"

#include "engine/base/crc.hpp"
#include "engine/features/orb_extractor.hpp"
#include "engine/features/orb_pattern.hpp"

namespace stillmesh {
namespace {

struct Parts {
    OrbExtractor extractor;
    FeatureSet features;
};

}  // namespace

OrbOptions orb_options(const FeatureParameters& parameters) noexcept {
    OrbOptions options;
    options.features_max = parameters.count;
    options.levels = parameters.levels;
    options.scale_factor = parameters.scale_factor;
    options.fast_threshold = static_cast<std::uint8_t>(parameters.fast_threshold);
    options.fast_threshold_low = static_cast<std::uint8_t>(parameters.fast_threshold_low);
    options.even_permille = 1000;  // a group of few strong corners is no rival: the mesh needs the whole picture
    return options;
}

std::size_t own_extractor_bytes(const Limits& limits) noexcept {
    ArenaPlan plan;
    plan.array<Parts>(1);
    OrbExtractor::plan(plan, limits);
    FeatureSet::plan(plan, limits.features_max);
    return plan.used_bytes();
}

Result<OwnExtractor> create_own_extractor(std::span<std::byte> block, const Limits& limits,
                                          const FeatureParameters& parameters, const Kernels& kernels) noexcept {
    if (block.size() < own_extractor_bytes(limits)) return Status::kFull;
    Arena arena(block);
    Parts& parts = arena.array<Parts>(1)[0];
    parts.extractor.create(arena, limits, orb_options(parameters), kernels);
    parts.features.create(arena, limits.features_max);
    arena.seal();
    return OwnExtractor{&parts.extractor, &parts.features};
}

std::uint32_t descriptor_pattern_crc() noexcept {
    const TurnedPattern& pattern = turned_pattern();
    Crc32 crc;
    for (const auto& turn : pattern.offsets) {
        for (const std::int16_t offset : turn) {
            const auto bits = static_cast<std::uint16_t>(offset);
            const std::byte bytes[2] = {static_cast<std::byte>(bits & 0xffU), static_cast<std::byte>(bits >> 8U)};
            crc.add(bytes);
        }
    }
    return crc.value();
}

}  // namespace stillmesh
