// Chooses the fastest kernels that this processor can run. The engine itself never asks the processor.
#pragma once

#include "engine/frame/kernels.hpp"

namespace stillmesh {

[[nodiscard]] const Kernels& cpu_kernels() noexcept;

}  // namespace stillmesh
