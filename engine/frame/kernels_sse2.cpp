#include "engine/frame/kernels.hpp"

namespace stillmesh {

const Kernels* sse2_kernels() noexcept {
    return nullptr;
}

}  // namespace stillmesh
