// Engine::create() and validate() with all numbers, the tuning of every room included: for tests and benches that vary
// what no program knows. Not installed.
#pragma once

#include <span>

#include "engine/engine.hpp"
#include "engine/parameters.hpp"

namespace stillmesh {

// What an engine is made of besides numbers; as in Engine::create().
struct EngineParts {
    const Kernels& kernels;
    FeatureExtractor* extractor = nullptr;
    std::span<const std::byte> vocabulary = {};
    MapStore* store = nullptr;
};
[[nodiscard]] STILLMESH_API Result<Engine*> create_engine(std::span<std::byte> block, const Limits& limits,
                                                          const Parameters& parameters, const CameraModel& camera,
                                                          const EngineParts& parts) noexcept;
[[nodiscard]] STILLMESH_API ConfigurationProblem validate(const Parameters& parameters, const Limits& limits) noexcept;

}  // namespace stillmesh
