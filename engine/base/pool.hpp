// A pool of equal objects behind generation handles. Released slots are reused first in, first out, so that a stale
// handle stays detectable for as long as possible. Limit: 2^32 - 2 slots. take/find/release are O(1).
#pragma once

#include <cstddef>
#include <cstdint>
#include <span>

#include "engine/base/arena.hpp"
#include "engine/base/check.hpp"
#include "engine/base/status.hpp"

namespace stillmesh {

// Names an object of a pool. A zeroed handle names nothing.
template <typename T>
struct Handle {
    std::uint32_t slot_plus_one = 0;
    std::uint32_t generation = 0;

    [[nodiscard]] constexpr bool is_null() const noexcept { return slot_plus_one == 0; }
    [[nodiscard]] constexpr std::uint32_t slot() const noexcept { return slot_plus_one - 1; }
    friend constexpr bool operator==(Handle, Handle) noexcept = default;
};

template <typename T>
class Pool {
public:
    static constexpr void plan(ArenaPlan& arena, std::size_t count_max) noexcept {
        arena.array<T>(count_max);
        arena.array<Slot>(count_max);
    }
    void create(Arena& arena, std::size_t count_max) noexcept {
        STILLMESH_CHECK(count_max < kNone);
        objects_ = arena.array<T>(count_max);
        slots_ = arena.array<Slot>(count_max);
        reset();
    }
    // Releases everything; old handles stay stale.
    void reset() noexcept {
        const auto count = static_cast<std::uint32_t>(slots_.size());
        for (std::uint32_t i = 0; i < count; ++i) {
            if (slots_[i].is_taken) ++slots_[i].generation;
            slots_[i].is_taken = false;
            slots_[i].next_free = i + 1 < count ? i + 1 : kNone;
        }
        first_free_ = count > 0 ? 0 : kNone;
        last_free_ = count > 0 ? count - 1 : kNone;
        size_ = 0;
    }

    // A value-initialised object. kFull: nothing changed, counted in refused().
    [[nodiscard]] Result<Handle<T>> take() noexcept {
        if (first_free_ == kNone) {
            ++refused_;
            return Status::kFull;
        }
        const std::uint32_t slot = first_free_;
        first_free_ = slots_[slot].next_free;
        if (first_free_ == kNone) last_free_ = kNone;
        slots_[slot].is_taken = true;
        objects_[slot] = T();
        if (++size_ > high_water_) high_water_ = size_;
        return Handle<T>{slot + 1, slots_[slot].generation};
    }

    // The handle must be alive.
    void release(Handle<T> handle) noexcept {
        STILLMESH_CHECK(find(handle) != nullptr);
        const std::uint32_t slot = handle.slot();
        slots_[slot].is_taken = false;
        ++slots_[slot].generation;
        slots_[slot].next_free = kNone;
        if (last_free_ == kNone) {
            first_free_ = slot;
        } else {
            slots_[last_free_].next_free = slot;
        }
        last_free_ = slot;
        --size_;
    }

    // Stale or null: nullptr.
    [[nodiscard]] T* find(Handle<T> handle) noexcept { return is_alive(handle) ? &objects_[handle.slot()] : nullptr; }
    [[nodiscard]] const T* find(Handle<T> handle) const noexcept {
        return is_alive(handle) ? &objects_[handle.slot()] : nullptr;
    }

    // By slot, for links inside the map and for walking over all objects in slot order (deterministic).
    [[nodiscard]] std::uint32_t slots_count() const noexcept { return static_cast<std::uint32_t>(slots_.size()); }
    [[nodiscard]] bool is_taken(std::uint32_t slot) const noexcept {
        return slot < slots_.size() && slots_[slot].is_taken;
    }
    // A hint that the slot and its object, taken or not, will be read soon: of the object its first two cache lines.
    void prefetch(std::uint32_t slot) const noexcept {
        constexpr std::size_t kCacheLine = 64;
        const auto* const bytes = reinterpret_cast<const char*>(&objects_[slot]);
        __builtin_prefetch(&slots_[slot]);
        __builtin_prefetch(bytes);
        __builtin_prefetch(bytes + kCacheLine);
    }
    [[nodiscard]] T& at(std::uint32_t slot) noexcept {
        STILLMESH_CHECK(is_taken(slot));
        return objects_[slot];
    }
    [[nodiscard]] const T& at(std::uint32_t slot) const noexcept {
        STILLMESH_CHECK(is_taken(slot));
        return objects_[slot];
    }
    [[nodiscard]] Handle<T> handle_of(std::uint32_t slot) const noexcept {
        STILLMESH_CHECK(is_taken(slot));
        return {slot + 1, slots_[slot].generation};
    }

    [[nodiscard]] std::size_t size() const noexcept { return size_; }
    [[nodiscard]] std::size_t capacity() const noexcept { return slots_.size(); }
    [[nodiscard]] std::size_t high_water() const noexcept { return high_water_; }
    [[nodiscard]] std::uint64_t refused() const noexcept { return refused_; }
    [[nodiscard]] bool is_full() const noexcept { return size_ == slots_.size(); }

private:
    static constexpr std::uint32_t kNone = 0xffffffffU;
    struct Slot {
        std::uint32_t generation = 1;
        std::uint32_t next_free = kNone;
        bool is_taken = false;
    };

    [[nodiscard]] bool is_alive(Handle<T> handle) const noexcept {
        return handle.slot_plus_one != 0 && handle.slot() < slots_.size() && slots_[handle.slot()].is_taken &&
               slots_[handle.slot()].generation == handle.generation;
    }

    std::span<T> objects_;
    std::span<Slot> slots_;
    std::uint32_t first_free_ = kNone;
    std::uint32_t last_free_ = kNone;
    std::size_t size_ = 0;
    std::size_t high_water_ = 0;
    std::uint64_t refused_ = 0;
};

}  // namespace stillmesh
