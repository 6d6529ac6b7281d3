// The one block of memory that the engine lives in, straight from the operating system: pages, hence aligned to far
// more than a cache line; pages never touched cost nothing.
#pragma once

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
    [[nodiscard]] bool allocate(std::size_t size_bytes) noexcept;
    void release() noexcept;
    [[nodiscard]] std::span<std::byte> bytes() const noexcept { return bytes_; }

private:
    std::span<std::byte> bytes_;
};

}  // namespace stillmesh
