// Chooses the fastest kernels that this processor can run. The engine itself never asks the processor.
// STILLMESH_KERNELS in the environment names others, for tests: plain, sse2, avx2 or neon (what this processor cannot
// run, and what nobody knows, is plain). All give the same bits.
#pragma once

#include "engine/frame/kernels.hpp"

namespace stillmesh {

[[nodiscard]] const Kernels& cpu_kernels() noexcept;

}  // namespace stillmesh
