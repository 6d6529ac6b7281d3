#include "platform/linux/memory_block.hpp"

#include <sys/mman.h>

namespace stillmesh {

bool MemoryBlock::allocate(std::size_t size_bytes) noexcept {
    release();
    void* const block = ::mmap(nullptr, size_bytes, PROT_READ | PROT_WRITE, MAP_PRIVATE | MAP_ANONYMOUS, -1, 0);
    if (block == MAP_FAILED) return false;
    bytes_ = {static_cast<std::byte*>(block), size_bytes};
    return true;
}

void MemoryBlock::release() noexcept {
    if (!bytes_.empty()) static_cast<void>(::munmap(bytes_.data(), bytes_.size()));
    bytes_ = {};
}

}  // namespace stillmesh
