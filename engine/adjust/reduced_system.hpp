// The normal equations of the keyframes alone, after the points are eliminated: symmetric positive definite, dense, in
// blocks of 6x6, lower triangle only, factorised by a block Cholesky column by column so that a slice can stop between
// two columns. n blocks take 288 n (n + 1) / 2 bytes and 36 n^3 multiplications; every sum in a fixed order.
#pragma once

#include <cstddef>
#include <cstdint>
#include <span>

#include "engine/base/arena.hpp"

namespace stillmesh {

class ReducedSystem {
public:
    static constexpr std::uint32_t kBlocksMax = 24;
    static constexpr std::uint32_t kWidth = 6;
    static constexpr std::uint32_t kBlockSize = kWidth * kWidth;  // doubles, row-major

    static constexpr void plan(ArenaPlan& arena, std::uint32_t blocks_max) noexcept {
        arena.array<double>(static_cast<std::size_t>(blocks_max) * (blocks_max + 1) / 2 * kBlockSize);
        arena.array<double>(static_cast<std::size_t>(blocks_max) * kWidth);
    }
    void create(Arena& arena, std::uint32_t blocks_max) noexcept;
    // All zero, of `blocks` block rows (at most blocks_max).
    void clear(std::uint32_t blocks) noexcept;

    [[nodiscard]] std::uint32_t blocks() const noexcept { return blocks_; }
    // Block (row, column), column <= row. Of a block on the diagonal only its lower triangle is read.
    [[nodiscard]] double* block(std::uint32_t row, std::uint32_t column) noexcept {
        return blocks_storage_.data() + static_cast<std::size_t>(row * (row + 1) / 2 + column) * kBlockSize;
    }
    // The right-hand side; after solve() the solution.
    [[nodiscard]] double* vector(std::uint32_t row) noexcept {
        return vector_.data() + static_cast<std::size_t>(row) * kWidth;
    }

    // Columns in order 0, 1, ...; false when the matrix is not (numerically) positive definite: then start over.
    [[nodiscard]] bool factor_column(std::uint32_t column) noexcept;
    // Block products in it, 216 multiplications each.
    [[nodiscard]] std::uint32_t products_of_column(std::uint32_t column) const noexcept {
        return (column + 1) * (blocks_ - column);
    }
    // After all columns.
    void solve() noexcept;

private:
    std::span<double> blocks_storage_;
    std::span<double> vector_;
    std::uint32_t blocks_ = 0;
};

}  // namespace stillmesh
