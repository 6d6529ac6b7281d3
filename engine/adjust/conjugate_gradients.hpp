// Preconditioned conjugate gradients (Hestenes and Stiefel 1952): x with A x = b, A symmetric positive definite, in
// blocks of six unknowns, a pose's. No matrix is stored: who multiplies by A, and by what is near A^-1, is the caller.
// An iteration is a few passes over the blocks, in whatever pieces and always in the same order; each pass ends with a
// call that says how it goes on:
//   precondition the caller: preconditioned = M^-1 residual; add_energy() of each block; then continues()
//   direct       update_direction() of each block; the caller: product = A direction
//   measure      add_curvature() of each block; then has_step()
//   advance      update_solution() of each block; then precondition again
// A block whose preconditioned residual stays zero holds still. Limits: iterations_max. Cost: 60 multiplications a
// block and iteration, besides the caller's two products.
#pragma once

#include <cstdint>

#include "engine/geometry/eigen.hpp"

namespace stillmesh {

struct ConjugateBlock {
    Vector6 solution;
    Vector6 residual;  // b - A solution
    Vector6 preconditioned;
    Vector6 direction;
    Vector6 product;  // A direction

    // `right`: b.
    void begin_at_zero(const Vector6& right) noexcept {
        solution.setZero();
        direction.setZero();
        residual = right;
    }
};

class ConjugateGradients {
public:
    // `residual_max`: of b, both in the preconditioner's norm.
    void begin(std::uint32_t iterations_max, double residual_max) noexcept;

    void add_energy(const ConjugateBlock& block) noexcept;
    // False: the residual is small enough (or not finite), or the iterations are used up; the solution stands.
    [[nodiscard]] bool continues() noexcept;
    void update_direction(ConjugateBlock& block) const noexcept;
    void add_curvature(const ConjugateBlock& block) noexcept;
    // False: A is not positive definite along the direction; the solution stands.
    [[nodiscard]] bool has_step() noexcept;
    void update_solution(ConjugateBlock& block) const noexcept;

    [[nodiscard]] std::uint32_t iterations() const noexcept { return iterations_; }

private:
    std::uint32_t iterations_max_ = 0;
    double residual_max_ = 0;
    std::uint32_t iterations_ = 0;
    // Residual times preconditioned residual: of this iteration, of the one before, of the first.
    double energy_ = 0, energy_before_ = 0, energy_first_ = 0;
    double curvature_ = 0;
    double share_ = 0;   // of the direction before in the next
    double length_ = 0;  // of the step, in directions
};

}  // namespace stillmesh
