// The bookkeeping of Levenberg-Marquardt, the same in every adjustment: cost at the best state so far and at a
// candidate, how much the model promised, and the damping, which follows how well it kept its promise (Nielsen 1999).
// What a step is is each adjustment's own. Cost: nothing.
#pragma once

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

[[nodiscard]] inline double squared_norm(const double (&v)[3]) noexcept {
    return v[0] * v[0] + v[1] * v[1] + v[2] * v[2];
}
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
        has_converged_ = is_exhausted_ = false;
    }
    // What is added to an element of the Hessian's diagonal. That counts as `least` at least: an unknown nobody
    // constrains stays where it is.
    [[nodiscard]] double damping_of(double diagonal, double least) const noexcept {
        return damping_ * (diagonal > least ? diagonal : least);
    }
    // The candidate's cost is known. True: it is better, and the current state from now on.
    // `cost_change_min`: a share; a step that lowers the cost by less is the last one. So is one that reaches
    // `cost_exact`.
    [[nodiscard]] bool judge(double cost_change_min, double cost_exact) noexcept {
        const double negligible = cost_change_min * cost;
        const double gain = cost - candidate_cost;
        if (!(gain > 0.0 && predicted > 0.0)) {
            // At the minimum the model promises nothing either.
            has_converged_ = predicted <= negligible && predicted >= -negligible;
            refuse();
            return false;
        }
        accept(gain);
        has_converged_ = gain <= negligible || cost <= cost_exact;
        return true;
    }
    // There is no candidate to judge: the step could not be computed.
    void refuse() noexcept {
        constexpr double kDampingMax = 1e10;
        damping_ *= growth_;
        growth_ *= 2.0;
        is_exhausted_ = damping_ > kDampingMax;
    }
    [[nodiscard]] bool has_converged() const noexcept { return has_converged_; }
    // Converged, or damping has grown so much that no step is left to try.
    [[nodiscard]] bool is_over() const noexcept { return has_converged_ || is_exhausted_; }

private:
    void accept(double gain) noexcept {
        constexpr double kDampingMin = 1e-12;
        cost = candidate_cost;
        const double surprise = 2.0 * (gain / predicted) - 1.0;
        const double factor = 1.0 - surprise * surprise * surprise;
        damping_ *= factor > 0.1 ? (factor < 2.0 ? factor : 2.0) : 0.1;
        if (damping_ < kDampingMin) damping_ = kDampingMin;
        growth_ = 2.0;
    }

    double damping_ = 0;
    double growth_ = 2;
    bool has_converged_ = false;
    bool is_exhausted_ = false;
};

}  // namespace stillmesh
