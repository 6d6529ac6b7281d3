#include "platform/linux/cpu_kernels.hpp"

#if defined(__arm__)
#include <asm/hwcap.h>
#include <sys/auxv.h>
#endif

namespace stillmesh {

const Kernels& cpu_kernels() noexcept {
#if defined(__x86_64__)
    // Asks the operating system too: registers it does not save are as good as absent.
    if (avx2_kernels() != nullptr && __builtin_cpu_supports("avx2") != 0 && __builtin_cpu_supports("popcnt") != 0)
        return *avx2_kernels();
#elif defined(__arm__)
    // Not every armv7 has it (Tegra 2, Armada); the kernel knows.
    if (neon_kernels() != nullptr && (::getauxval(AT_HWCAP) & HWCAP_NEON) != 0) return *neon_kernels();
    return plain_kernels();
#elif defined(__aarch64__)
    if (neon_kernels() != nullptr) return *neon_kernels();
#endif
    if (sse2_kernels() != nullptr) return *sse2_kernels();
    return plain_kernels();
}

}  // namespace stillmesh
