#include "engine/adjust/conjugate_gradients.hpp"

#include <gtest/gtest.h>

#include <cmath>
#include <cstdint>
#include <limits>
#include <vector>

#include "engine/adjust/descent.hpp"
#include "engine/base/random.hpp"
#include "engine/geometry/cholesky.hpp"

namespace stillmesh::conjugate_gradients_test {
namespace {

// A dense system of `blocks` poses, by blocks; `inverse`: the preconditioner, by blocks too.
struct System {
    std::vector<std::vector<Matrix6>> a;
    std::vector<Vector6> right;

    [[nodiscard]] std::size_t blocks() const { return right.size(); }
    [[nodiscard]] std::vector<Vector6> times(const std::vector<Vector6>& x) const {
        std::vector<Vector6> out(blocks(), Vector6::Zero());
        for (std::size_t i = 0; i < blocks(); ++i) {
            for (std::size_t j = 0; j < blocks(); ++j) out[i] += a[i][j] * x[j];
        }
        return out;
    }
};

double dot(const std::vector<Vector6>& x, const std::vector<Vector6>& y) {
    double sum = 0;
    for (std::size_t i = 0; i < x.size(); ++i) sum += x[i].dot(y[i]);
    return sum;
}

Vector6 draw(Random& random) {
    Vector6 v;
    for (int k = 0; k < 6; ++k) v(k) = random.uniform(-1, 1);
    return v;
}

// B B^T + I with a random B whose rows grow: some hundred between the least and the largest of its diagonal.
System random_system(std::size_t blocks, std::uint64_t seed) {
    Random random(seed);
    const std::size_t n = 6 * blocks;
    std::vector<double> b(n * n);
    for (std::size_t i = 0; i < n; ++i) {
        for (std::size_t j = 0; j < n; ++j) b[i * n + j] = random.uniform(-1, 1) * (1.0 + static_cast<double>(i % 6));
    }
    System out;
    out.a.assign(blocks, std::vector<Matrix6>(blocks, Matrix6::Zero()));
    for (std::size_t i = 0; i < n; ++i) {
        for (std::size_t j = 0; j < n; ++j) {
            double sum = i == j ? 1.0 : 0.0;
            for (std::size_t k = 0; k < n; ++k) sum += b[i * n + k] * b[j * n + k];
            out.a[i / 6][j / 6](static_cast<int>(i % 6), static_cast<int>(j % 6)) = sum;
        }
    }
    for (std::size_t i = 0; i < blocks; ++i) out.right.push_back(draw(random));
    return out;
}

// A solve that can be stopped after every block of every pass, as its users do.
class Solve {
public:
    enum class Preconditioner { kNone, kBlocks };

    Solve(const System& system, Preconditioner preconditioner, std::uint32_t iterations_max, double residual_max)
        : system_(&system), blocks_(system.blocks()) {
        gradients_.begin(iterations_max, residual_max);
        for (std::size_t i = 0; i < blocks_.size(); ++i) {
            blocks_[i].begin_at_zero(system.right[i]);
            factors_.push_back(preconditioner == Preconditioner::kNone ? Matrix6(Matrix6::Identity()) : system.a[i][i]);
            EXPECT_TRUE(cholesky(factors_.back(), is_good_pivot));
        }
    }
    void hold_still(std::size_t block) { still_ = block; }

    // One block of one pass; false: the solve is over.
    bool step() {
        ConjugateBlock& block = blocks_[cursor_];
        switch (pass_) {
            case Pass::kPrecondition:
                block.preconditioned = block.residual;
                solve_lower(factors_[cursor_], block.preconditioned);
                solve_lower_transposed(factors_[cursor_], block.preconditioned);
                if (cursor_ == still_) block.preconditioned.setZero();
                gradients_.add_energy(block);
                break;
            case Pass::kDirect: gradients_.update_direction(block); break;
            case Pass::kMultiply:
                block.product.setZero();
                for (std::size_t j = 0; j < blocks_.size(); ++j) {
                    block.product += system_->a[cursor_][j] * blocks_[j].direction;
                }
                break;
            case Pass::kMeasure: gradients_.add_curvature(block); break;
            case Pass::kAdvance: gradients_.update_solution(block); break;
        }
        if (++cursor_ < blocks_.size()) return true;
        cursor_ = 0;
        switch (pass_) {
            case Pass::kPrecondition: pass_ = Pass::kDirect; return gradients_.continues();
            case Pass::kDirect: pass_ = Pass::kMultiply; return true;
            case Pass::kMultiply: pass_ = Pass::kMeasure; return true;
            case Pass::kMeasure: pass_ = Pass::kAdvance; return gradients_.has_step();
            case Pass::kAdvance: pass_ = Pass::kPrecondition; return true;
        }
        return false;
    }
    std::uint32_t run() {
        while (step()) {
        }
        return gradients_.iterations();
    }
    [[nodiscard]] std::vector<Vector6> solution() const {
        std::vector<Vector6> out;
        for (const ConjugateBlock& block : blocks_) out.push_back(block.solution);
        return out;
    }
    [[nodiscard]] std::vector<Vector6> residual() const {
        std::vector<Vector6> out;
        for (const ConjugateBlock& block : blocks_) out.push_back(block.residual);
        return out;
    }

private:
    enum class Pass { kPrecondition, kDirect, kMultiply, kMeasure, kAdvance };
    const System* system_;
    std::vector<ConjugateBlock> blocks_;
    std::vector<Matrix6> factors_;
    ConjugateGradients gradients_;
    Pass pass_ = Pass::kPrecondition;
    std::size_t cursor_ = 0;
    std::size_t still_ = std::numeric_limits<std::size_t>::max();
};

// Gaussian elimination with pivots, a textbook's.
std::vector<Vector6> solve_densely(const System& system) {
    const std::size_t n = 6 * system.blocks();
    std::vector<std::vector<double>> rows(n, std::vector<double>(n + 1));
    for (std::size_t i = 0; i < n; ++i) {
        const auto r = static_cast<int>(i % 6);
        for (std::size_t j = 0; j < n; ++j) rows[i][j] = system.a[i / 6][j / 6](r, static_cast<int>(j % 6));
        rows[i][n] = system.right[i / 6](r);
    }
    for (std::size_t c = 0; c < n; ++c) {
        std::size_t pivot = c;
        for (std::size_t i = c; i < n; ++i) {
            if (std::fabs(rows[i][c]) > std::fabs(rows[pivot][c])) pivot = i;
        }
        std::swap(rows[c], rows[pivot]);
        for (std::size_t i = 0; i < n; ++i) {
            if (i == c) continue;
            const double factor = rows[i][c] / rows[c][c];
            for (std::size_t j = c; j <= n; ++j) rows[i][j] -= factor * rows[c][j];
        }
    }
    std::vector<Vector6> out(system.blocks());
    for (std::size_t i = 0; i < n; ++i) out[i / 6](static_cast<int>(i % 6)) = rows[i][n] / rows[i][i];
    return out;
}

double worst_difference(const std::vector<Vector6>& x, const std::vector<Vector6>& y) {
    double worst = 0;
    for (std::size_t i = 0; i < x.size(); ++i) worst = std::max(worst, (x[i] - y[i]).cwiseAbs().maxCoeff());
    return worst;
}

// Promise: the solution is a dense solve's, with and without a preconditioner, and the residual it carries is the
// system's own.
TEST(ConjugateGradients, SolvesWhatADenseSolveSolves) {
    for (const std::size_t blocks : {1U, 2U, 7U, 15U}) {
        const System system = random_system(blocks, blocks);
        const std::vector<Vector6> truth = solve_densely(system);
        for (const auto preconditioner : {Solve::Preconditioner::kNone, Solve::Preconditioner::kBlocks}) {
            Solve solve(system, preconditioner, 2000, 1e-13);
            EXPECT_GT(solve.run(), 0U);
            EXPECT_LT(worst_difference(solve.solution(), truth), 1e-9) << blocks;
            std::vector<Vector6> left = system.times(solve.solution());
            for (std::size_t i = 0; i < blocks; ++i) left[i] = system.right[i] - left[i];
            EXPECT_LT(worst_difference(left, solve.residual()), 1e-9) << blocks;
        }
    }
}

// Promise: every iteration comes nearer to the solution, in the norm of the system; the preconditioner saves some.
TEST(ConjugateGradients, EveryIterationComesNearer) {
    const System system = random_system(8, 3);
    const std::vector<Vector6> truth = solve_densely(system);
    double before = dot(truth, system.times(truth));
    for (std::uint32_t iterations = 1; iterations <= 30; ++iterations) {
        Solve solve(system, Solve::Preconditioner::kBlocks, iterations, 0.0);
        ASSERT_EQ(solve.run(), iterations);
        std::vector<Vector6> off = solve.solution();
        for (std::size_t i = 0; i < off.size(); ++i) off[i] -= truth[i];
        const double now = dot(off, system.times(off));
        EXPECT_LT(now, before) << iterations;
        before = now;
    }
    Solve bare(system, Solve::Preconditioner::kNone, 2000, 1e-6);
    Solve preconditioned(system, Solve::Preconditioner::kBlocks, 2000, 1e-6);
    EXPECT_LT(preconditioned.run(), bare.run());
}

// Promise: as many iterations as the preconditioned system has different eigenvalues: one where it is known exactly,
// two where it is known up to two factors.
TEST(ConjugateGradients, TakesAnIterationForEachEigenvalue) {
    System system = random_system(6, 9);
    for (std::size_t i = 0; i < system.blocks(); ++i) {
        for (std::size_t j = 0; j < system.blocks(); ++j) {
            if (i != j) system.a[i][j].setZero();
        }
    }
    Solve exact(system, Solve::Preconditioner::kBlocks, 100, 1e-9);
    EXPECT_EQ(exact.run(), 1U);
    EXPECT_LT(worst_difference(exact.solution(), solve_densely(system)), 1e-12);

    for (std::size_t i = 0; i < system.blocks(); ++i) {
        system.a[i][i] = Matrix6::Identity() * (i % 2 == 0 ? 3.0 : 50.0);
    }
    Solve two(system, Solve::Preconditioner::kNone, 100, 1e-9);
    EXPECT_EQ(two.run(), 2U);
    EXPECT_LT(worst_difference(two.solution(), solve_densely(system)), 1e-12);
}

// Promise: no more iterations than allowed, none included; the residual asked for is reached and not overdone.
TEST(ConjugateGradients, StopsWhereItIsTold) {
    const System system = random_system(5, 4);
    for (const std::uint32_t iterations_max : {0U, 1U, 3U}) {
        Solve solve(system, Solve::Preconditioner::kBlocks, iterations_max, 1e-12);
        EXPECT_EQ(solve.run(), iterations_max);
        EXPECT_EQ(dot(solve.solution(), solve.solution()) > 0, iterations_max > 0);
    }
    for (const double residual_max : {0.1, 1e-3, 1e-6}) {
        // Without a preconditioner its norm is the plain one.
        Solve solve(system, Solve::Preconditioner::kNone, 1000, residual_max);
        const std::uint32_t iterations = solve.run();
        EXPECT_LE(std::sqrt(dot(solve.residual(), solve.residual())),
                  residual_max * std::sqrt(dot(system.right, system.right)));
        Solve shorter(system, Solve::Preconditioner::kNone, iterations - 1, residual_max);
        shorter.run();
        EXPECT_GT(std::sqrt(dot(shorter.residual(), shorter.residual())),
                  residual_max * std::sqrt(dot(system.right, system.right)));
    }
}

// Promise: a right-hand side of nothing takes no iteration; one that is not finite, or a system that is not positive
// definite, ends the solve with what it had.
TEST(ConjugateGradients, EndsWhereThereIsNothingToSolve) {
    System system = random_system(3, 5);
    System nothing = system;
    for (Vector6& right : nothing.right) right.setZero();
    Solve idle(nothing, Solve::Preconditioner::kBlocks, 100, 1e-9);
    EXPECT_EQ(idle.run(), 0U);
    EXPECT_EQ(dot(idle.solution(), idle.solution()), 0.0);

    System broken = system;
    broken.right[1](2) = std::numeric_limits<double>::quiet_NaN();
    Solve unsolved(broken, Solve::Preconditioner::kBlocks, 100, 1e-9);
    EXPECT_EQ(unsolved.run(), 0U);
    EXPECT_EQ(dot(unsolved.solution(), unsolved.solution()), 0.0);

    for (std::vector<Matrix6>& row : system.a) {
        for (Matrix6& block : row) block = -block;
    }
    Solve downhill(system, Solve::Preconditioner::kNone, 100, 1e-9);
    EXPECT_EQ(downhill.run(), 1U);
    EXPECT_EQ(dot(downhill.solution(), downhill.solution()), 0.0);
}

// Promise: a block whose preconditioned residual is zero holds still, and the others are solved as if it were known.
TEST(ConjugateGradients, ABlockCanHoldStill) {
    const System system = random_system(4, 6);
    Solve solve(system, Solve::Preconditioner::kBlocks, 1000, 1e-13);
    solve.hold_still(1);
    solve.run();
    EXPECT_EQ(solve.solution()[1].squaredNorm(), 0.0);
    System smaller;
    for (const std::size_t i : {0U, 2U, 3U}) {
        smaller.right.push_back(system.right[i]);
        smaller.a.push_back({system.a[i][0], system.a[i][2], system.a[i][3]});
    }
    const std::vector<Vector6> truth = solve_densely(smaller);
    EXPECT_LT(worst_difference({solve.solution()[0], solve.solution()[2], solve.solution()[3]}, truth), 1e-10);
}

// Promise: a copy taken after any block goes on to the same bits.
TEST(ConjugateGradients, ACopyGoesOnAlike) {
    const System system = random_system(4, 8);
    Solve whole(system, Solve::Preconditioner::kBlocks, 12, 1e-12);
    const std::uint32_t iterations = whole.run();
    Solve original(system, Solve::Preconditioner::kBlocks, 12, 1e-12);
    bool is_going_on = true;
    while (is_going_on) {
        Solve copy = original;
        ASSERT_EQ(copy.run(), iterations);
        ASSERT_EQ(worst_difference(copy.solution(), whole.solution()), 0.0);
        is_going_on = original.step();
    }
}

}  // namespace
}  // namespace stillmesh::conjugate_gradients_test
