// The engine's own feature extractor in memory of its own, for programs that need features without an engine: the
// trainer of vocabularies. Cost: that of the features of a frame.
#pragma once

#include <cstddef>
#include <cstdint>
#include <span>

#include "engine/base/api.hpp"
#include "engine/base/status.hpp"
#include "engine/configuration.hpp"
#include "engine/features/features.hpp"
#include "engine/frame/kernels.hpp"
#include "engine/limits.hpp"

namespace stillmesh {

// The features found, in the extractor's memory, until its next extract().
struct OwnExtractor {
    FeatureExtractor* extractor = nullptr;
    FeatureSet* features = nullptr;  // room for limits.features_max, to be handed to extract()
};

// Valid for limits that validate() accepts.
[[nodiscard]] STILLMESH_API std::size_t own_extractor_bytes(const Limits& limits) noexcept;
// Inside `block` (aligned to kArenaAlignment), which must outlive it, as must `kernels`. Limits and parameters are
// those that validate() accepts.
//   kFull  block too small
[[nodiscard]] STILLMESH_API Result<OwnExtractor> create_own_extractor(std::span<std::byte> block, const Limits& limits,
                                                                      const FeatureParameters& parameters,
                                                                      const Kernels& kernels) noexcept;
// Of the sampling pattern: descriptors of another pattern are another language.
[[nodiscard]] STILLMESH_API std::uint32_t descriptor_pattern_crc() noexcept;

}  // namespace stillmesh
