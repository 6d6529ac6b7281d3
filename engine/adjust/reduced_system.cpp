#include "engine/adjust/reduced_system.hpp"

#include <cmath>

#include "engine/base/check.hpp"

namespace stillmesh {
namespace {

constexpr std::uint32_t kN = ReducedSystem::kWidth;
constexpr std::uint32_t kSize = ReducedSystem::kBlockSize;

// A pivot that is less than this share of its diagonal element is what rounding left of nothing.
constexpr double kRounding = 1e-13;
constexpr double kHuge = 1e150;  // squares of it are still finite

void transpose(const double* from, double* to) noexcept {
    for (std::uint32_t r = 0; r < kN; ++r) {
        for (std::uint32_t c = 0; c < kN; ++c) to[c * kN + r] = from[r * kN + c];
    }
}

// s -= a * b, with b's rows contiguous: elementwise along a row, so that the order of sums is the source's whatever
// width the compiler chooses.
void subtract_product(double* __restrict s, const double* a, const double* b) noexcept {
    for (std::uint32_t r = 0; r < kN; ++r) {
        for (std::uint32_t m = 0; m < kN; ++m) {
            const double factor = a[r * kN + m];
            for (std::uint32_t c = 0; c < kN; ++c) s[r * kN + c] -= factor * b[m * kN + c];
        }
    }
}

// In place: the lower triangle of `a` becomes its Cholesky factor. `diagonal`: of the matrix before any elimination.
bool factor_block(double* a, const double* diagonal) noexcept {
    for (std::uint32_t i = 0; i < kN; ++i) {
        for (std::uint32_t j = 0; j < i; ++j) {
            double sum = a[i * kN + j];
            for (std::uint32_t k = 0; k < j; ++k) sum -= a[i * kN + k] * a[j * kN + k];
            a[i * kN + j] = sum / a[j * kN + j];
        }
        double pivot = a[i * kN + i];
        for (std::uint32_t k = 0; k < i; ++k) pivot -= a[i * kN + k] * a[i * kN + k];
        if (!(pivot > kRounding * diagonal[i] && pivot > 0.0 && pivot < kHuge)) return false;  // NaN too
        a[i * kN + i] = std::sqrt(pivot);
    }
    return true;
}

}  // namespace

void ReducedSystem::create(Arena& arena, std::uint32_t blocks_max) noexcept {
    STILLMESH_CHECK(blocks_max <= kBlocksMax);
    blocks_storage_ = arena.array<double>(static_cast<std::size_t>(blocks_max) * (blocks_max + 1) / 2 * kBlockSize);
    vector_ = arena.array<double>(static_cast<std::size_t>(blocks_max) * kWidth);
    blocks_ = 0;
}

void ReducedSystem::clear(std::uint32_t blocks) noexcept {
    STILLMESH_CHECK(static_cast<std::size_t>(blocks) * kWidth <= vector_.size());
    blocks_ = blocks;
    const std::size_t used = static_cast<std::size_t>(blocks) * (blocks + 1) / 2 * kBlockSize;
    for (std::size_t i = 0; i < used; ++i) blocks_storage_[i] = 0.0;
    for (std::size_t i = 0; i < static_cast<std::size_t>(blocks) * kWidth; ++i) vector_[i] = 0.0;
}

bool ReducedSystem::factor_column(std::uint32_t column) noexcept {
    double* const pivot_block = block(column, column);
    double diagonal[kN];
    for (std::uint32_t i = 0; i < kN; ++i) diagonal[i] = pivot_block[i * kN + i];
    // Left-looking: take from this column what the columns before it explain.
    double* const y = vector(column);
    for (std::uint32_t j = 0; j < column; ++j) {
        const double* const l = block(column, j);
        double transposed[kSize];
        transpose(l, transposed);
        for (std::uint32_t i = column; i < blocks_; ++i) subtract_product(block(i, column), block(i, j), transposed);
        const double* const y_j = vector(j);
        for (std::uint32_t r = 0; r < kN; ++r) {
            for (std::uint32_t c = 0; c < kN; ++c) y[r] -= l[r * kN + c] * y_j[c];
        }
    }
    if (!factor_block(pivot_block, diagonal)) return false;
    double inverse[kN];
    for (std::uint32_t i = 0; i < kN; ++i) inverse[i] = 1.0 / pivot_block[i * kN + i];
    for (std::uint32_t i = column + 1; i < blocks_; ++i) {
        double* const b = block(i, column);
        for (std::uint32_t r = 0; r < kN; ++r) {
            double* const row = b + r * kN;
            for (std::uint32_t c = 0; c < kN; ++c) {
                double sum = row[c];
                for (std::uint32_t m = 0; m < c; ++m) sum -= row[m] * pivot_block[c * kN + m];
                row[c] = sum * inverse[c];
            }
        }
    }
    // Forward substitution goes along.
    for (std::uint32_t r = 0; r < kN; ++r) {
        for (std::uint32_t m = 0; m < r; ++m) y[r] -= pivot_block[r * kN + m] * y[m];
        y[r] *= inverse[r];
    }
    return true;
}

void ReducedSystem::solve() noexcept {
    for (std::uint32_t k = blocks_; k-- > 0;) {
        double* const x = vector(k);
        for (std::uint32_t i = k + 1; i < blocks_; ++i) {
            const double* const l = block(i, k);
            const double* const x_i = vector(i);
            for (std::uint32_t r = 0; r < kN; ++r) {
                for (std::uint32_t c = 0; c < kN; ++c) x[c] -= l[r * kN + c] * x_i[r];
            }
        }
        const double* const l = block(k, k);
        for (std::uint32_t r = kN; r-- > 0;) {
            for (std::uint32_t m = r + 1; m < kN; ++m) x[r] -= l[m * kN + r] * x[m];
            x[r] /= l[r * kN + r];
        }
    }
}

}  // namespace stillmesh
