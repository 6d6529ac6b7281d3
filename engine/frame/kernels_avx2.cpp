#include "engine/frame/kernels.hpp"

namespace stillmesh {

const Kernels* avx2_kernels() noexcept {
    return nullptr;
}

}  // namespace stillmesh
