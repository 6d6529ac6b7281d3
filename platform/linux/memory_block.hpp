// The one block of memory that the engine lives in, straight from the operating system: pages, hence aligned to far
// more than the cache line that Engine::create asks for; pages never touched cost nothing. Given back with the object.
//
//   MemoryBlock block;
//   if (!block.allocate(bytes_needed(limits))) ...
//   const auto made = Engine::create(block.bytes(), limits, configuration, camera, cpu_kernels());
#pragma once

#include <sys/mman.h>

#include <cstddef>
#include <span>

namespace stillmesh {

class MemoryBlock {
public:
    MemoryBlock() = default;
    ~MemoryBlock() { release(); }
    MemoryBlock(const MemoryBlock&) = delete;
    MemoryBlock& operator=(const MemoryBlock&) = delete;

    // False: the operating system has not that much. What was held before is given back.
    [[nodiscard]] bool allocate(std::size_t size_bytes) noexcept {
        release();
        void* const block = ::mmap(nullptr, size_bytes, PROT_READ | PROT_WRITE, MAP_PRIVATE | MAP_ANONYMOUS, -1, 0);
        if (block == MAP_FAILED) return false;
        bytes_ = {static_cast<std::byte*>(block), size_bytes};
        return true;
    }
    void release() noexcept {
        if (!bytes_.empty()) static_cast<void>(::munmap(bytes_.data(), bytes_.size()));
        bytes_ = {};
    }
    [[nodiscard]] std::span<std::byte> bytes() const noexcept { return bytes_; }

private:
    std::span<std::byte> bytes_;
};

}  // namespace stillmesh
