// Sequences with a limit: FixedVector over arena memory, its limit set at create; InlineVector with its storage inside.
#pragma once

#include <array>
#include <cstddef>
#include <span>

#include "engine/base/arena.hpp"
#include "engine/base/check.hpp"

namespace stillmesh {

// What both can do. Elements are trivially destructible. push() on a full vector returns false and changes nothing.
template <typename T, typename Storage>
class LimitedVector {
public:
    [[nodiscard]] bool push(const T& value) noexcept {
        if (is_full()) return false;
        storage_[size_++] = value;
        return true;
    }
    // Sets the count without touching the elements.
    void set_size(std::size_t count) noexcept {
        STILLMESH_CHECK(count <= storage_.size());
        size_ = count;
    }
    void clear() noexcept { size_ = 0; }

    [[nodiscard]] std::size_t size() const noexcept { return size_; }
    [[nodiscard]] std::size_t capacity() const noexcept { return storage_.size(); }
    [[nodiscard]] bool is_empty() const noexcept { return size_ == 0; }
    [[nodiscard]] bool is_full() const noexcept { return size_ == storage_.size(); }

    [[nodiscard]] T& operator[](std::size_t i) noexcept {
        STILLMESH_CHECK(i < size_);
        return storage_[i];
    }
    [[nodiscard]] const T& operator[](std::size_t i) const noexcept {
        STILLMESH_CHECK(i < size_);
        return storage_[i];
    }
    [[nodiscard]] T* begin() noexcept { return storage_.data(); }
    [[nodiscard]] T* end() noexcept { return storage_.data() + size_; }
    [[nodiscard]] const T* begin() const noexcept { return storage_.data(); }
    [[nodiscard]] const T* end() const noexcept { return storage_.data() + size_; }
    [[nodiscard]] std::span<T> span() noexcept { return {storage_.data(), size_}; }
    [[nodiscard]] std::span<const T> span() const noexcept { return {storage_.data(), size_}; }

protected:
    Storage storage_{};
    std::size_t size_ = 0;
};

template <typename T>
class FixedVector : public LimitedVector<T, std::span<T>> {
public:
    static constexpr void plan(ArenaPlan& arena, std::size_t count_max) noexcept { arena.array<T>(count_max); }
    void create(Arena& arena, std::size_t count_max) noexcept {
        this->storage_ = arena.array<T>(count_max);
        this->size_ = 0;
    }
};

template <typename T, std::size_t kCapacity>
class InlineVector : public LimitedVector<T, std::array<T, kCapacity>> {};

}  // namespace stillmesh
