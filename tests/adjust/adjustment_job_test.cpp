#include "engine/adjust/adjustment_job.hpp"

#include <gtest/gtest.h>

namespace stillmesh::adjustment_job_test {
namespace {

enum class HalvingPhase : std::uint8_t { kPropose, kEvaluate };
struct HalvingOptions {
    double damping_initial = 1;
    double cost_change_min = 0.3;
};
struct HalvingSummary {
    std::uint32_t steps_accepted = 0, iterations = 0;
    std::uint64_t units = 0;
};

// Every second candidate halves the cost, the others double it; three units a piece.
class Halving : public AdjustmentJob<Halving, HalvingPhase, HalvingOptions, HalvingSummary> {
public:
    void start(const HalvingOptions& options, double cost) {
        run(options);
        descent_.cost = cost;
        next_iteration();
    }
    [[nodiscard]] double cost() const { return descent_.cost; }
    [[nodiscard]] std::uint32_t current() const { return current_; }

private:
    friend AdjustmentJob;
    std::uint32_t next_piece() noexcept {
        if (phase_ == HalvingPhase::kPropose) {
            if (summary_.iterations == 3) {
                refuse();
            } else {
                enter(HalvingPhase::kEvaluate);
            }
        } else {
            descent_.candidate_cost = descent_.cost * (summary_.iterations % 2 == 1 ? 0.5 : 2.0);
            descent_.predicted = descent_.cost;
            judge(1.0);
        }
        return 3;
    }
    void next_iteration() noexcept {
        if (descent_.is_over()) {
            state_ = State::kDone;
            return;
        }
        ++summary_.iterations;
        enter(HalvingPhase::kPropose);
    }
};

// Promise: a job takes the better candidates alone, ends at its exact cost, and is the same job in slices of any size.
TEST(AdjustmentJob, TheSameInAnySlices) {
    for (const std::uint32_t slice : {1U, 4U, 1000U}) {
        Halving job;
        WorkBudget nothing(10);
        EXPECT_EQ(job.step(nothing), Progress::kIdle);
        EXPECT_EQ(nothing.units_spent(), 0U);
        job.start(HalvingOptions{}, 4.0);
        EXPECT_TRUE(job.is_running());
        for (Progress progress = Progress::kWorking; progress != Progress::kDone;) {
            WorkBudget budget(slice);
            progress = job.step(budget);
            ASSERT_NE(progress, Progress::kIdle);
        }
        ASSERT_TRUE(job.is_done());
        // 4 to 2; refused as worse; refused without a candidate; worse; 2 to 1.
        EXPECT_EQ(job.cost(), 1.0);
        EXPECT_EQ(job.summary().iterations, 5U);
        EXPECT_EQ(job.summary().steps_accepted, 2U);
        EXPECT_EQ(job.current(), 0U) << "two states, taken in turn";
        EXPECT_EQ(job.summary().units, 27U);
    }
}

// Promise: what a running job has found is not to be had.
TEST(AdjustmentJobDeathTest, ResultsAreReadWhenDone) {
    Halving job;
    EXPECT_DEATH(static_cast<void>(job.summary()), "is_done");
    job.start(HalvingOptions{}, 4.0);
    EXPECT_DEATH(static_cast<void>(job.summary()), "is_done");
    EXPECT_DEATH(job.start(HalvingOptions{}, 4.0), "state_");
}

}  // namespace
}  // namespace stillmesh::adjustment_job_test
