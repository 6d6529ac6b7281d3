#include "platform/linux/cpu_kernels.hpp"

namespace stillmesh {

const Kernels& cpu_kernels() noexcept {
#if defined(__x86_64__)
    // Asks the operating system too: registers it does not save are as good as absent.
    if (avx2_kernels() != nullptr && __builtin_cpu_supports("avx2") != 0 && __builtin_cpu_supports("popcnt") != 0)
        return *avx2_kernels();
#endif
    if (sse2_kernels() != nullptr) return *sse2_kernels();
    return plain_kernels();
}

}  // namespace stillmesh
