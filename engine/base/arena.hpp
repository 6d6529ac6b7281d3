// One block of memory, given by the caller, cut into arrays while the engine is created and sealed afterwards: no
// memory is taken after that. `ArenaPlan` does the same arithmetic without memory, so that bytes_needed(limits) is
// known at compile time and equals what `Arena` uses to the byte.
#pragma once

#include <cstddef>
#include <cstdint>
#include <new>
#include <span>
#include <type_traits>

#include "engine/base/check.hpp"

namespace stillmesh {

// Every array starts on a cache line: no false sharing with DMA, and SIMD loads of a row start aligned.
inline constexpr std::size_t kArenaAlignment = 64;

[[nodiscard]] constexpr std::size_t align_up(std::size_t bytes, std::size_t alignment) noexcept {
    return (bytes + alignment - 1) / alignment * alignment;
}

class ArenaPlan {
public:
    template <typename T>
    constexpr void array(std::size_t count) noexcept {
        static_assert(alignof(T) <= kArenaAlignment);
        used_bytes_ = align_up(used_bytes_, kArenaAlignment) + count * sizeof(T);
    }
    // As Arena's: one list of arrays, over either, plans and creates.
    template <typename T>
    constexpr void take(std::span<T>&, std::size_t count) noexcept {
        array<T>(count);
    }
    [[nodiscard]] constexpr std::size_t used_bytes() const noexcept { return used_bytes_; }

private:
    std::size_t used_bytes_ = 0;
};

class Arena {
public:
    // `block` must be aligned to kArenaAlignment and outlive everything created in it.
    explicit Arena(std::span<std::byte> block) noexcept : block_(block) {
        STILLMESH_CHECK(reinterpret_cast<std::uintptr_t>(block.data()) % kArenaAlignment == 0);
    }

    // `count` value-initialised elements. Running out is our bug (the plan was wrong), hence a CHECK.
    template <typename T>
    [[nodiscard]] std::span<T> array(std::size_t count) noexcept {
        static_assert(alignof(T) <= kArenaAlignment);
        static_assert(std::is_trivially_destructible_v<T>, "nothing in the arena is ever destroyed");
        STILLMESH_CHECK(!sealed_);
        const std::size_t begin = align_up(used_bytes_, kArenaAlignment);
        STILLMESH_CHECK(begin <= block_.size() && count <= (block_.size() - begin) / sizeof(T));
        used_bytes_ = begin + count * sizeof(T);
        T* const first = reinterpret_cast<T*>(block_.data() + begin);
        for (std::size_t i = 0; i < count; ++i) ::new (static_cast<void*>(first + i)) T();
        return {first, count};
    }

    template <typename T>
    void take(std::span<T>& out, std::size_t count) noexcept {
        out = array<T>(count);
    }

    void seal() noexcept { sealed_ = true; }
    [[nodiscard]] bool is_sealed() const noexcept { return sealed_; }
    [[nodiscard]] std::size_t used_bytes() const noexcept { return used_bytes_; }

private:
    std::span<std::byte> block_;
    std::size_t used_bytes_ = 0;
    bool sealed_ = false;
};

}  // namespace stillmesh
