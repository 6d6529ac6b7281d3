#include "platform/linux/cpu_kernels.hpp"

#include <cstdlib>
#include <cstring>

#if defined(__arm__)
#include <asm/hwcap.h>
#include <sys/auxv.h>
#endif

namespace stillmesh {
namespace {

// Whether this processor, and its operating system, have what they need; nullptr: not even compiled for it.
bool can_run(const Kernels* kernels) noexcept {
    if (kernels == nullptr) return false;
#if defined(__x86_64__)
    // Asks the operating system too: registers it does not save are as good as absent.
    if (kernels == avx2_kernels()) return __builtin_cpu_supports("avx2") != 0 && __builtin_cpu_supports("popcnt") != 0;
#elif defined(__arm__)
    // Not every armv7 has it (Tegra 2, Armada); the kernel knows.
    if (kernels == neon_kernels()) return (::getauxval(AT_HWCAP) & HWCAP_NEON) != 0;
#endif
    return true;
}

}  // namespace

const Kernels& cpu_kernels() noexcept {
    const Kernels* const best_first[] = {avx2_kernels(), neon_kernels(), sse2_kernels()};
    const char* const wanted = std::getenv("STILLMESH_KERNELS");
    for (const Kernels* const kernels : best_first) {
        if (!can_run(kernels)) continue;
        if (wanted == nullptr || *wanted == '\0' || std::strcmp(wanted, kernels->name) == 0) return *kernels;
    }
    return plain_kernels();
}

}  // namespace stillmesh
