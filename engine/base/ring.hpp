// A ring with a limit set at create: push to the back, pop from the front; or push_over, which forgets the oldest.
#pragma once

#include <cstddef>
#include <span>

#include "engine/base/arena.hpp"
#include "engine/base/check.hpp"

namespace stillmesh {

template <typename T>
class Ring {
public:
    static constexpr void plan(ArenaPlan& arena, std::size_t count_max) noexcept { arena.array<T>(count_max); }
    void create(Arena& arena, std::size_t count_max) noexcept {
        STILLMESH_CHECK(count_max > 0);
        storage_ = arena.array<T>(count_max);
        clear();
    }

    [[nodiscard]] bool push(const T& value) noexcept {
        if (size_ == storage_.size()) return false;
        storage_[(first_ + size_) % storage_.size()] = value;
        ++size_;
        return true;
    }
    void push_over(const T& value) noexcept {
        if (size_ == storage_.size()) pop();
        STILLMESH_CHECK(push(value));
    }
    void pop() noexcept {
        STILLMESH_CHECK(size_ > 0);
        first_ = (first_ + 1) % storage_.size();
        --size_;
    }
    void clear() noexcept {
        first_ = 0;
        size_ = 0;
    }
    // 0 is the oldest.
    [[nodiscard]] T& operator[](std::size_t i) noexcept {
        STILLMESH_CHECK(i < size_);
        return storage_[(first_ + i) % storage_.size()];
    }
    [[nodiscard]] const T& operator[](std::size_t i) const noexcept {
        STILLMESH_CHECK(i < size_);
        return storage_[(first_ + i) % storage_.size()];
    }
    [[nodiscard]] const T& newest() const noexcept { return (*this)[size_ - 1]; }
    [[nodiscard]] std::size_t size() const noexcept { return size_; }
    [[nodiscard]] std::size_t capacity() const noexcept { return storage_.size(); }
    [[nodiscard]] bool is_empty() const noexcept { return size_ == 0; }

private:
    std::span<T> storage_;
    std::size_t first_ = 0;
    std::size_t size_ = 0;
};

}  // namespace stillmesh
