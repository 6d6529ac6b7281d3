// Small symmetric positive definite systems, as a pose's, by Cholesky: plain loops in a fixed order of sums. Of the
// matrix only the lower triangle is read and written. Which pivot is too small to go on with is the caller's to say:
// it depends on what the matrix was made of.
#pragma once

#include <cmath>

#include "engine/geometry/eigen.hpp"

namespace stillmesh {

// In place: the lower triangle becomes L with L L^T = a. False: is_good(pivot, its diagonal element before) was not.
template <int N, typename IsGoodPivot>
[[nodiscard]] bool cholesky(Eigen::Matrix<double, N, N>& a, IsGoodPivot&& is_good) noexcept {
    for (int i = 0; i < N; ++i) {
        const double diagonal = a(i, i);
        for (int j = 0; j <= i; ++j) {
            double sum = a(i, j);
            for (int k = 0; k < j; ++k) sum -= a(i, k) * a(j, k);
            if (i == j) {
                if (!is_good(sum, diagonal)) return false;
                a(i, i) = std::sqrt(sum);
            } else {
                a(i, j) = sum / a(j, j);
            }
        }
    }
    return true;
}

// x = L^-1 x and x = L^-T x; `x` is anything of as many numbers with [].
template <int N, typename X>
void solve_lower(const Eigen::Matrix<double, N, N>& l, X& x) noexcept {
    for (int i = 0; i < N; ++i) {
        for (int k = 0; k < i; ++k) x[i] -= l(i, k) * x[k];
        x[i] /= l(i, i);
    }
}
template <int N, typename X>
void solve_lower_transposed(const Eigen::Matrix<double, N, N>& l, X& x) noexcept {
    for (int i = N - 1; i >= 0; --i) {
        for (int k = i + 1; k < N; ++k) x[i] -= l(k, i) * x[k];
        x[i] /= l(i, i);
    }
}

}  // namespace stillmesh
