// What all adjustments are, whatever they adjust: jobs that can stop anywhere, done piece by piece, Levenberg-Marquardt
// between a best state and a candidate; and what those that have no matrix share beyond that, steps by conjugate
// gradients. `Self` is the adjustment (CRTP: calls through pointers would hide from the check of the stack), `Phase`
// what its pieces are, in order. Cost: nothing but the adjustments' own.
#pragma once

#include <cstdint>
#include <utility>

#include "engine/adjust/conjugate_gradients.hpp"
#include "engine/adjust/descent.hpp"
#include "engine/base/check.hpp"
#include "engine/schedule/task.hpp"

namespace stillmesh {

// `Self` has next_piece(), which returns the units it took, and next_iteration().
template <typename Self, typename Phase, typename Options, typename Summary>
class AdjustmentJob {
public:
    // kDone: this call finished the job. kIdle: no job is running.
    [[nodiscard]] Progress step(WorkBudget& budget) noexcept {
        if (state_ != State::kRunning) return Progress::kIdle;
        return work_in_pieces(
            budget, summary_.units, [this] { return self().next_piece(); }, [this] { return is_done(); });
    }
    [[nodiscard]] bool is_running() const noexcept { return state_ == State::kRunning; }
    [[nodiscard]] bool is_done() const noexcept { return state_ == State::kDone; }
    // Only when is_done() (CHECK).
    [[nodiscard]] const Summary& summary() const noexcept {
        STILLMESH_CHECK(is_done());
        return summary_;
    }

protected:
    enum class State : std::uint8_t { kCollecting, kFilling, kRunning, kDone };

    [[nodiscard]] Self& self() noexcept { return static_cast<Self&>(*this); }
    void run(const Options& options) noexcept {
        STILLMESH_CHECK(state_ != State::kRunning && state_ != State::kDone);
        STILLMESH_CHECK(options.damping_initial > 0 && options.cost_change_min >= 0);
        options_ = options;
        summary_ = Summary{};
        state_ = State::kRunning;
        current_ = 0;
        descent_.begin(options.damping_initial);
        descent_.cost = 0.0;
    }
    void enter(Phase phase) noexcept {
        phase_ = phase;
        cursor_ = 0;
    }
    // The candidate's cost is known; one below `cost_exact` ends the search.
    void judge(double cost_exact) noexcept {
        if (descent_.judge(options_.cost_change_min, cost_exact)) {
            current_ = 1 - current_;
            ++summary_.steps_accepted;
        }
        self().next_iteration();
    }
    // There is no candidate.
    void refuse() noexcept {
        descent_.refuse();
        self().next_iteration();
    }

    Options options_;
    Summary summary_;
    State state_ = State::kCollecting;
    Phase phase_ = Phase{};
    std::uint32_t cursor_ = 0;   // of the phase
    std::uint32_t current_ = 0;  // which of two states is the best so far
    Descent descent_;
};

// Six unknowns, a pose's, of an adjustment without a matrix. `solution`: the step. What does not move has no vectors
// that are read, but for its direction, which is 0.
struct DescentBlock : ConjugateBlock {
    Matrix6 diagonal;  // of the system; then its Cholesky factor
    Vector6 damping;   // added to the diagonal
    Vector6 gradient;
    bool moves = false;
};

// The system is a sum of terms. `Self` has blocks() and terms(), kBlocksOfPiece, kBlockUnits and kTermsOfPiece; of one
// block clear(), and move(), which makes its candidate; of one term linearise(), multiply() and evaluate(), which
// return its units. How it preconditions is its own: from kFactorise and kAdvance it comes to go_on().
template <typename Self, typename Phase, typename Options, typename Summary>
class MatrixFreeJob : public AdjustmentJob<Self, Phase, Options, Summary> {
    using Job = AdjustmentJob<Self, Phase, Options, Summary>;

protected:
    using Job::cursor_, Job::descent_, Job::enter, Job::options_, Job::self, Job::summary_;

    // A piece of a phase over blocks; then() when it was the last.
    template <typename Visit, typename Then>
    std::uint32_t each_block(Visit&& visit, Then&& then) noexcept {
        const auto blocks = self().blocks();
        for (std::uint32_t n = 0; n < Self::kBlocksOfPiece && cursor_ < blocks.size(); ++n) visit(blocks[cursor_++]);
        if (cursor_ == blocks.size()) then();
        return Self::kBlockUnits;
    }
    // The same of those that move.
    template <typename Visit, typename Then>
    std::uint32_t each_moving_block(Visit&& visit, Then&& then) noexcept {
        const auto visit_moving = [&visit](auto& block) {
            if (block.moves) visit(block);
        };
        return each_block(visit_moving, std::forward<Then>(then));
    }
    // The same over terms: one that is not full takes as long as one that is.
    template <typename Visit, typename Then>
    std::uint32_t each_term(Visit&& visit, Then&& then) noexcept {
        const auto terms = self().terms();
        std::uint32_t units = 0;
        for (std::uint32_t n = 0; n < Self::kTermsOfPiece && cursor_ < terms.size(); ++n) {
            units = visit(terms[cursor_++]);
        }
        if (cursor_ == terms.size()) then();
        return Self::kTermsOfPiece * units;
    }

    void next_iteration() noexcept {
        if (descent_.is_over() || summary_.iterations >= options_.iterations_max || self().blocks().empty() ||
            self().terms().empty()) {
            summary_.has_converged = descent_.has_converged();
            summary_.final_cost = descent_.cost;
            this->state_ = Job::State::kDone;
            return;
        }
        ++summary_.iterations;
        enter(Phase::kClear);
    }
    std::uint32_t clear_sums() noexcept {
        descent_.cost = 0.0;
        is_singular_ = false;
        return each_block([this](auto& block) { self().clear(block); }, [this] { enter(Phase::kLinearise); });
    }
    std::uint32_t linearise_terms() noexcept {
        return each_term([this](auto& term) { return self().linearise(term); },
                         [this] {
                             if (summary_.iterations == 1) summary_.initial_cost = descent_.cost;
                             inner_.begin(options_.inner_iterations_max, options_.inner_residual_max);
                             enter(Phase::kFactorise);
                         });
    }
    std::uint32_t direct() noexcept {
        return each_moving_block(
            [this](auto& block) {
                inner_.update_direction(block);
                for (int i = 0; i < 6; ++i) block.product[i] = block.damping[i] * block.direction[i];
            },
            [this] { enter(Phase::kMultiply); });
    }
    std::uint32_t multiply_terms() noexcept {
        return each_term([this](auto& term) { return self().multiply(term); }, [this] { enter(Phase::kMeasure); });
    }
    std::uint32_t measure() noexcept {
        return each_moving_block([this](const auto& block) { inner_.add_curvature(block); },
                                 [this] { inner_.has_step() ? enter(Phase::kAdvance) : end_inner(); });
    }
    // The preconditioned residuals are known.
    void go_on() noexcept { inner_.continues() ? enter(Phase::kDirect) : end_inner(); }
    void end_inner() noexcept {
        summary_.inner_iterations += inner_.iterations();
        descent_.predicted = 0.0;
        enter(Phase::kCandidate);
    }
    std::uint32_t make_candidate() noexcept {
        return each_moving_block(
            [this](auto& block) {
                if (is_sane_step(block.solution)) {
                    self().move(block);
                } else {
                    is_singular_ = true;
                }
            },
            [this] {
                descent_.candidate_cost = 0.0;
                is_singular_ ? this->refuse() : enter(Phase::kEvaluate);
            });
    }
    std::uint32_t evaluate_terms(double cost_exact) noexcept {
        return each_term([this](auto& term) { return self().evaluate(term); },
                         [this, cost_exact] { this->judge(cost_exact); });
    }

    ConjugateGradients inner_;
    bool is_singular_ = false;
};

}  // namespace stillmesh
