// Sequences with a limit set at create: FixedVector over arena memory, InlineVector with its storage inside.
#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <span>

#include "engine/base/arena.hpp"
#include "engine/base/check.hpp"

namespace stillmesh {

// Elements are trivially destructible. push() on a full vector returns false and changes nothing.
template <typename T>
class FixedVector {
public:
    static constexpr void plan(ArenaPlan& arena, std::size_t count_max) noexcept { arena.array<T>(count_max); }
    void create(Arena& arena, std::size_t count_max) noexcept {
        storage_ = arena.array<T>(count_max);
        size_ = 0;
        high_water_ = 0;
    }

    [[nodiscard]] bool push(const T& value) noexcept {
        if (size_ == storage_.size()) return false;
        storage_[size_++] = value;
        if (size_ > high_water_) high_water_ = size_;
        return true;
    }
    // Sets the count without touching the elements: for callers that fill the storage themselves.
    void set_size(std::size_t count) noexcept {
        STILLMESH_CHECK(count <= storage_.size());
        size_ = count;
        if (size_ > high_water_) high_water_ = size_;
    }
    void pop() noexcept {
        STILLMESH_CHECK(size_ > 0);
        --size_;
    }
    void clear() noexcept { size_ = 0; }

    [[nodiscard]] std::size_t size() const noexcept { return size_; }
    [[nodiscard]] std::size_t capacity() const noexcept { return storage_.size(); }
    [[nodiscard]] std::size_t high_water() const noexcept { return high_water_; }
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
    [[nodiscard]] std::span<T> span() noexcept { return storage_.first(size_); }
    [[nodiscard]] std::span<const T> span() const noexcept { return storage_.first(size_); }
    // The whole storage, beyond size(): for callers that fill it and then call set_size().
    [[nodiscard]] std::span<T> storage() noexcept { return storage_; }

private:
    std::span<T> storage_;
    std::size_t size_ = 0;
    std::size_t high_water_ = 0;
};

template <typename T, std::size_t kCapacity>
class InlineVector {
public:
    [[nodiscard]] bool push(const T& value) noexcept {
        if (size_ == kCapacity) return false;
        storage_[size_++] = value;
        return true;
    }
    void clear() noexcept { size_ = 0; }
    [[nodiscard]] std::size_t size() const noexcept { return size_; }
    [[nodiscard]] static constexpr std::size_t capacity() noexcept { return kCapacity; }
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
    [[nodiscard]] std::span<const T> span() const noexcept { return {storage_.data(), size_}; }

private:
    std::array<T, kCapacity> storage_{};
    std::size_t size_ = 0;
};

}  // namespace stillmesh
