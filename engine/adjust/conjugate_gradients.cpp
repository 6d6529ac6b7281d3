#include "engine/adjust/conjugate_gradients.hpp"

namespace stillmesh {

void ConjugateGradients::begin(std::uint32_t iterations_max, double residual_max) noexcept {
    *this = ConjugateGradients{};
    iterations_max_ = iterations_max;
    residual_max_ = residual_max;
}

void ConjugateGradients::add_energy(const ConjugateBlock& block) noexcept {
    for (int i = 0; i < 6; ++i) energy_ += block.residual(i) * block.preconditioned(i);
}

bool ConjugateGradients::continues() noexcept {
    if (iterations_ == 0) energy_first_ = energy_;
    if (!(energy_ > residual_max_ * residual_max_ * energy_first_)) return false;  // NaN too
    if (iterations_ == iterations_max_) return false;
    share_ = iterations_ == 0 ? 0.0 : energy_ / energy_before_;
    ++iterations_;
    curvature_ = 0.0;
    return true;
}

void ConjugateGradients::update_direction(ConjugateBlock& block) const noexcept {
    for (int i = 0; i < 6; ++i) block.direction(i) = block.preconditioned(i) + share_ * block.direction(i);
}

void ConjugateGradients::add_curvature(const ConjugateBlock& block) noexcept {
    for (int i = 0; i < 6; ++i) curvature_ += block.direction(i) * block.product(i);
}

bool ConjugateGradients::has_step() noexcept {
    if (!(curvature_ > 0.0)) return false;
    length_ = energy_ / curvature_;
    energy_before_ = energy_;
    energy_ = 0.0;
    return true;
}

void ConjugateGradients::update_solution(ConjugateBlock& block) const noexcept {
    for (int i = 0; i < 6; ++i) {
        block.solution(i) += length_ * block.direction(i);
        block.residual(i) -= length_ * block.product(i);
    }
}

}  // namespace stillmesh
