// An engine in a block of exactly the needed size.
#pragma once

#include <cmath>
#include <cstdint>
#include <cstring>

#include "engine/engine.hpp"
#include "engine/tuned_engine.hpp"
#include "platform/linux/cpu_kernels.hpp"
#include "tests/support/frames.hpp"
#include "tests/support/memory.hpp"

namespace stillmesh::test {

// What fits into these limits.
inline Parameters fitting(const Limits& limits) {
    Parameters out;
    if (out.features.count > limits.features_max) out.features.count = limits.features_max;
    if (out.features.levels > limits.pyramid_levels_max) out.features.levels = limits.pyramid_levels_max;
    if (out.mapping.window_keyframes > limits.keyframes_max) out.mapping.window_keyframes = limits.keyframes_max;
    return out;
}

class EngineRig {
public:
    EngineRig(const Limits& limits, const CameraModel& camera, const Parameters& parameters,
              const Kernels& kernels = cpu_kernels(), int garbage = 0, FeatureExtractor* extractor = nullptr)
        : memory_(bytes_needed(limits)) {
        std::memset(memory_.span().data(), garbage, memory_.span().size());
        made_ = create_engine(memory_.span(), limits, parameters, camera, {kernels, extractor});
    }
    EngineRig(const Limits& limits, const CameraModel& camera) : EngineRig(limits, camera, fitting(limits)) {}
    [[nodiscard]] Status status() const { return made_.status(); }
    [[nodiscard]] Engine* operator->() const { return made_.value(); }
    [[nodiscard]] Engine& operator*() const { return *made_.value(); }

private:
    Memory memory_;
    Result<Engine*> made_{Status::kInvalid};
};

// Camera positions relative to a first frame: how far off an estimate is, m.
inline double metres_off(const RigidTransform& estimate, const SimulatedPose& first, const SimulatedPose& now) {
    const double x = first.q[0], y = first.q[1], z = first.q[2], w = first.q[3];
    const double r[3][3] = {{1 - 2 * (y * y + z * z), 2 * (x * y - z * w), 2 * (x * z + y * w)},
                            {2 * (x * y + z * w), 1 - 2 * (x * x + z * z), 2 * (y * z - x * w)},
                            {2 * (x * z - y * w), 2 * (y * z + x * w), 1 - 2 * (x * x + y * y)}};
    double sum = 0;
    for (std::size_t i = 0; i < 3; ++i) {
        double in_first = 0;  // R^T (t - t_first)
        for (std::size_t k = 0; k < 3; ++k) in_first += r[k][i] * (now.t[k] - first.t[k]);
        sum += (in_first - estimate.translation_m[i]) * (in_first - estimate.translation_m[i]);
    }
    return std::sqrt(sum);
}

}  // namespace stillmesh::test
