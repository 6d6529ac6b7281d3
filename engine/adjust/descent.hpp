// The bookkeeping of Levenberg-Marquardt, the same in every adjustment: cost at the best state so far and at a
// candidate, how much the model promised, and the damping, which follows how well it kept its promise (Nielsen 1999).
// What a step is, and when a cost is as good as solved, is each adjustment's own. Cost: nothing.
#pragma once

#include <cstdint>

#include "engine/geometry/se3.hpp"

namespace stillmesh {

// A smaller share of the diagonal in a pivot is rounding; squares of the larger are still finite.
inline constexpr double kPivotRounding = 1e-14;
inline constexpr double kPivotHuge = 1e150;

[[nodiscard]] inline bool is_good_pivot(double pivot, double diagonal) noexcept {
    return pivot > kPivotRounding * diagonal && pivot > 0.0 && pivot < kPivotHuge;  // not NaN either
}

// No step is larger: beyond, the model has nothing to do with the problem.
inline constexpr double kStepMax_m = 1e6;
inline constexpr double kStepMax_rad = 1.0;

[[nodiscard]] inline bool is_sane_step(double metres2) noexcept {
    return metres2 <= kStepMax_m * kStepMax_m;  // not NaN either
}
[[nodiscard]] inline bool is_sane_step(const Vector6& xi) noexcept {
    const double metres2 = xi.head<3>().squaredNorm();
    const double radians2 = xi.tail<3>().squaredNorm();
    return is_sane_step(metres2) && radians2 <= kStepMax_rad * kStepMax_rad;
}

class Descent {
public:
    double cost = 0;            // at the current state
    double candidate_cost = 0;  // at the candidate
    double predicted = 0;       // decrease of the cost, were the model exact

    void begin(double damping_initial) noexcept {
        damping_ = damping_initial;
        growth_ = 2.0;
    }
    // What is added to an element of the Hessian's diagonal. That counts as `least` at least: an unknown nobody
    // constrains stays where it is.
    [[nodiscard]] double damping_of(double diagonal, double least) const noexcept {
        return damping_ * (diagonal > least ? diagonal : least);
    }
    [[nodiscard]] bool is_better() const noexcept { return cost - candidate_cost > 0.0 && predicted > 0.0; }
    // The candidate is the current state from now on; how much better it is.
    double accept() noexcept {
        constexpr double kDampingMin = 1e-12;
        const double gain = cost - candidate_cost;
        cost = candidate_cost;
        const double surprise = 2.0 * (gain / predicted) - 1.0;
        const double factor = 1.0 - surprise * surprise * surprise;
        damping_ *= factor > 0.1 ? (factor < 2.0 ? factor : 2.0) : 0.1;
        if (damping_ < kDampingMin) damping_ = kDampingMin;
        growth_ = 2.0;
        return gain;
    }
    // False: damping has grown so much that no step is left to try.
    [[nodiscard]] bool refuse() noexcept {
        constexpr double kDampingMax = 1e10;
        damping_ *= growth_;
        growth_ *= 2.0;
        return !(damping_ > kDampingMax);
    }

private:
    double damping_ = 0;
    double growth_ = 2;
};

}  // namespace stillmesh
