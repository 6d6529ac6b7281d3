#include "engine/schedule/scheduler.hpp"

#include <gtest/gtest.h>

#include <algorithm>
#include <cstdint>
#include <vector>

#include "engine/base/random.hpp"
#include "engine/schedule/task.hpp"
#include "tests/support/check_message.hpp"

namespace stillmesh::scheduler_test {
namespace {

// Jobs made of steps that cannot be cut, each with its own cost; the trace is what was done, in order, by all tasks.
class StepTask final : public Task {
public:
    StepTask(int name, std::vector<int>& trace) : name_(name), trace_(trace) {}
    void add_job(std::vector<std::uint32_t> steps) { jobs_.push_back(std::move(steps)); }
    [[nodiscard]] std::size_t steps_left() const {
        std::size_t left = 0;
        for (std::size_t i = job_; i < jobs_.size(); ++i) left += jobs_[i].size();
        return left - step_;
    }
    [[nodiscard]] std::size_t jobs_done() const { return job_; }

    Progress step(WorkBudget& budget) noexcept override {
        if (job_ == jobs_.size()) return Progress::kIdle;
        while (!budget.is_spent()) {
            budget.spend(jobs_[job_][step_]);
            trace_.push_back(name_);
            if (++step_ < jobs_[job_].size()) continue;
            step_ = 0;
            ++job_;
            return Progress::kDone;
        }
        return Progress::kWorking;
    }

private:
    int name_;
    std::vector<int>& trace_;
    std::vector<std::vector<std::uint32_t>> jobs_;
    std::size_t job_ = 0, step_ = 0;
};

std::uint64_t hash_of(const Scheduler& scheduler) {
    StateHash hash;
    scheduler.add_to(hash);
    return hash.value();
}

std::vector<std::uint32_t> random_steps(Random& random, std::uint32_t count, std::uint32_t cost_max) {
    std::vector<std::uint32_t> steps;
    for (std::uint32_t i = 0; i < count; ++i) steps.push_back(1 + random.below(cost_max));
    return steps;
}

// Promise: without tasks, or with tasks that have nothing to do, a grant is idle and lost, and nothing else happens.
TEST(Scheduler, NothingToDo) {
    Scheduler scheduler;
    scheduler.create(10);
    EXPECT_EQ(scheduler.step(100), Progress::kIdle);
    std::vector<int> trace;
    StepTask task(1, trace);
    scheduler.add(task);
    EXPECT_EQ(scheduler.step(100), Progress::kIdle);
    const ScheduleStatistics& statistics = scheduler.statistics();
    EXPECT_EQ(statistics.steps, 2U);
    EXPECT_EQ(statistics.steps_idle, 2U);
    EXPECT_EQ(statistics.slices, 0U);
    EXPECT_EQ(statistics.units_granted, 200U);
    EXPECT_EQ(statistics.units_lost, 200U);
    EXPECT_EQ(statistics.units_spent, 0U);
}

// Promise: the first task is served before the second, also when its work comes while the second is busy: at most two
// slices later.
TEST(Scheduler, TheFirstTaskGoesFirst) {
    std::vector<int> trace;
    StepTask mapping(1, trace);
    StepTask loop(2, trace);
    Scheduler scheduler;
    scheduler.create(10);
    scheduler.add(mapping);
    scheduler.add(loop);
    loop.add_job(std::vector<std::uint32_t>(100, 1));
    mapping.add_job(std::vector<std::uint32_t>(25, 1));
    EXPECT_EQ(scheduler.step(50), Progress::kWorking);
    std::vector<int> expected(25, 1);
    expected.insert(expected.end(), 25, 2);
    EXPECT_EQ(trace, expected);
    mapping.add_job(std::vector<std::uint32_t>(5, 1));
    EXPECT_EQ(scheduler.step(10), Progress::kWorking);
    expected.insert(expected.end(), 5, 1);
    expected.insert(expected.end(), 5, 2);
    EXPECT_EQ(trace, expected);
    EXPECT_EQ(scheduler.step(1000), Progress::kDone);
    EXPECT_EQ(scheduler.units_spent_by(0), 30U);
    EXPECT_EQ(scheduler.units_spent_by(1), 100U);
    EXPECT_EQ(scheduler.step(1), Progress::kIdle);
}

// Promise: a job of J units that comes every few frames is finished within its units and those of the turns that the
// task below it has meanwhile, a turn for three, whatever that has to do; and while the task above asks for less than
// is granted, the one below gets the rest.
TEST(Scheduler, NoTaskStarves) {
    Random random(3);
    for (int round = 0; round < 50; ++round) {
        std::vector<int> trace;
        StepTask mapping(1, trace);
        StepTask loop(2, trace);
        Scheduler scheduler;
        const std::uint32_t slice_units = 1 + random.below(60);
        scheduler.create(slice_units);
        scheduler.add(mapping);
        scheduler.add(loop);
        const std::uint32_t units_per_frame = 1 + random.below(200);
        const std::uint32_t ceiling = 1 + random.below(40);
        loop.add_job(std::vector<std::uint32_t>(100'000, 1 + random.below(ceiling)));
        std::uint64_t needed = 0;
        for (int job = 0; job < 20; ++job) {
            const auto steps = random_steps(random, 1 + random.below(50), ceiling);
            std::uint64_t units = 0;
            for (const std::uint32_t step : steps) units += step;
            needed += units;
            mapping.add_job(steps);
            const std::uint64_t turns_below = units / (3 * slice_units) + 1;
            const std::uint64_t units_max = units + ceiling + turns_below * (slice_units + ceiling);
            const std::uint64_t frames_max = (units_max + units_per_frame - 1) / units_per_frame;
            for (std::uint64_t frame = 0; frame < frames_max; ++frame) {
                static_cast<void>(scheduler.step(units_per_frame));
            }
            ASSERT_EQ(mapping.steps_left(), 0U) << "round " << round << ", job " << job;
        }
        ASSERT_GT(loop.steps_left(), 0U) << "the load must be constant";
        EXPECT_EQ(scheduler.units_spent_by(0), needed);
        // All that was granted was used: nothing lost, nothing invented.
        const ScheduleStatistics& s = scheduler.statistics();
        EXPECT_EQ(s.units_lost, 0U);
        EXPECT_GE(s.units_spent, s.units_granted);
        EXPECT_LT(s.units_spent, s.units_granted + ceiling);
        EXPECT_LE(s.largest_overdraw_units, ceiling);
    }
}

// Promise: of two tasks that always have work the first gets three quarters and the last one quarter of the units,
// but for what the steps of a turn overdraw.
TEST(Scheduler, TheLastTaskHasATurn) {
    std::vector<int> trace;
    StepTask mapping(1, trace);
    StepTask loop(2, trace);
    Scheduler scheduler;
    scheduler.create(200);
    scheduler.add(mapping);
    scheduler.add(loop);
    mapping.add_job(std::vector<std::uint32_t>(10'000, 3));
    loop.add_job(std::vector<std::uint32_t>(10'000, 7));
    for (int frame = 0; frame < 500; ++frame) static_cast<void>(scheduler.step(16));
    EXPECT_NEAR(static_cast<double>(scheduler.units_spent_by(0)), 6000, 6000 * 7 / 200);
    EXPECT_NEAR(static_cast<double>(scheduler.units_spent_by(1)), 2000, 2000 * 7 / 200);
}

// Promise: a task behind another gets what that one leaves, in every turn, and nothing while it has work: beside a task
// that always has some, all of the quarter, but for what the task before it needed.
TEST(Scheduler, ATaskBehindAnotherWaitsForIt) {
    std::vector<int> trace;
    StepTask mapping(1, trace);
    StepTask loop(2, trace);
    StepTask refinement(3, trace);
    Scheduler scheduler;
    scheduler.create(200);
    scheduler.add(mapping);
    scheduler.add(loop);
    scheduler.add_behind(refinement);
    mapping.add_job(std::vector<std::uint32_t>(10'000, 2));
    loop.add_job(std::vector<std::uint32_t>(250, 2));
    refinement.add_job(std::vector<std::uint32_t>(10'000, 2));
    for (int frame = 0; frame < 100; ++frame) {
        static_cast<void>(scheduler.step(80));
        if (loop.steps_left() > 0) {
            ASSERT_EQ(scheduler.units_spent_by(2), 0U) << frame;
        }
    }
    EXPECT_EQ(scheduler.units_spent_by(0), 6000U);
    EXPECT_EQ(scheduler.units_spent_by(1), 500U);
    EXPECT_EQ(scheduler.units_spent_by(2), 1500U);
    // New work of the task before it goes first again.
    trace.clear();
    loop.add_job(std::vector<std::uint32_t>(100, 2));
    while (loop.steps_left() > 0) static_cast<void>(scheduler.step(80));
    EXPECT_EQ(std::count(trace.begin(), trace.end(), 3), 0);
}

// Promise: however the units are cut, three tasks do the same, one of them behind another; the hash sees all of them.
TEST(Scheduler, SameWorkOfThreeTasksHoweverCut) {
    Random random(17);
    for (int round = 0; round < 100; ++round) {
        const std::uint32_t slice_units = 1 + random.below(100);
        std::vector<int> traces[2];
        StepTask tasks[2][3] = {{{1, traces[0]}, {2, traces[0]}, {3, traces[0]}},
                                {{1, traces[1]}, {2, traces[1]}, {3, traces[1]}}};
        Scheduler schedulers[2];
        for (int k = 0; k < 2; ++k) {
            schedulers[k].create(slice_units);
            schedulers[k].add(tasks[k][0]);
            schedulers[k].add(tasks[k][1]);
            schedulers[k].add_behind(tasks[k][2]);
        }
        for (int frame = 0; frame < 40; ++frame) {
            for (int i = 0; i < 3; ++i) {
                if (random.below(3) == 0) continue;
                const auto job = random_steps(random, 1 + random.below(20), 1 + random.below(50));
                for (auto& three : tasks) three[i].add_job(job);
            }
            const std::uint32_t units = random.below(400);
            static_cast<void>(schedulers[0].step(units));
            for (std::uint32_t left = units; left > 0;) {
                const std::uint32_t part = random.below(left + 1);
                static_cast<void>(schedulers[1].step(part));
                left -= part;
            }
            ASSERT_EQ(traces[0], traces[1]) << "round " << round << ", frame " << frame;
            ASSERT_EQ(hash_of(schedulers[0]), hash_of(schedulers[1])) << "round " << round << ", frame " << frame;
        }
    }
}

// Promise: the same units give the same steps in the same order and the same hash, in whatever parts they are granted,
// for two tasks; parts of 0 change nothing.
TEST(Scheduler, SameWorkOfTwoTasksHoweverCut) {
    Random random(11);
    for (int round = 0; round < 200; ++round) {
        const std::uint32_t slice_units = 1 + random.below(100);
        std::vector<int> traces[2];
        StepTask tasks[2][2] = {{{1, traces[0]}, {2, traces[0]}}, {{1, traces[1]}, {2, traces[1]}}};
        Scheduler schedulers[2];
        for (int k = 0; k < 2; ++k) {
            schedulers[k].create(slice_units);
            for (StepTask& task : tasks[k]) schedulers[k].add(task);
        }
        for (int frame = 0; frame < 40; ++frame) {
            for (int i = 0; i < 2; ++i) {
                if (random.below(3) == 0) continue;
                const auto job = random_steps(random, 1 + random.below(20), 1 + random.below(50));
                for (auto& pair : tasks) pair[i].add_job(job);
            }
            const std::uint32_t units = random.below(400);
            static_cast<void>(schedulers[0].step(units));
            for (std::uint32_t left = units; left > 0;) {
                const std::uint32_t part = random.below(left + 1);
                static_cast<void>(schedulers[1].step(part));
                left -= part;
            }
            ASSERT_EQ(traces[0], traces[1]) << "round " << round << ", frame " << frame;
        }
    }
}

// Promise: the same units give the same steps in the same order and the same hash, in whatever parts they are granted
// and whatever the size of a slice, for one task; parts of 0 change nothing.
TEST(Scheduler, SameWorkHoweverCut) {
    Random random(7);
    for (int round = 0; round < 200; ++round) {
        const auto steps = random_steps(random, 200, 1 + random.below(50));
        const std::uint32_t slice_units = 1 + random.below(100);
        std::vector<int> whole_trace;
        StepTask whole_task(1, whole_trace);
        Scheduler whole;
        whole.create(slice_units);
        whole.add(whole_task);
        whole_task.add_job(steps);
        std::vector<int> cut_trace;
        StepTask cut_task(1, cut_trace);
        Scheduler cut;
        cut.create(1 + random.below(100));
        cut.add(cut_task);
        cut_task.add_job(steps);
        for (int frame = 0; frame < 40; ++frame) {
            const std::uint32_t units = random.below(400);
            static_cast<void>(whole.step(units));
            for (std::uint32_t left = units; left > 0;) {
                const std::uint32_t part = random.below(left + 1);
                static_cast<void>(cut.step(part));
                left -= part;
            }
            ASSERT_EQ(whole_trace, cut_trace) << "round " << round << ", frame " << frame;
            ASSERT_EQ(hash_of(whole), hash_of(cut)) << "round " << round << ", frame " << frame;
        }
        ASSERT_EQ(whole_task.steps_left(), 0U);
    }
}

// Promise: a budget of 0 does nothing at all, and says that work may wait.
TEST(Scheduler, BudgetOfZero) {
    std::vector<int> trace;
    StepTask task(1, trace);
    Scheduler scheduler;
    scheduler.create(10);
    scheduler.add(task);
    task.add_job({5, 5});
    const std::uint64_t before = hash_of(scheduler);
    for (int i = 0; i < 10; ++i) EXPECT_EQ(scheduler.step(0), Progress::kWorking);
    EXPECT_TRUE(trace.empty());
    EXPECT_EQ(hash_of(scheduler), before);
    EXPECT_EQ(scheduler.statistics().steps, 10U);
}

// Promise: what a step overdraws is paid by the next grants before anything else is done.
TEST(Scheduler, DebtIsPaid) {
    std::vector<int> trace;
    StepTask task(1, trace);
    Scheduler scheduler;
    scheduler.create(10);
    scheduler.add(task);
    task.add_job({100, 1, 1});
    EXPECT_EQ(scheduler.step(10), Progress::kWorking);  // owes 90
    for (int i = 0; i < 9; ++i) EXPECT_EQ(scheduler.step(10), Progress::kWorking);
    EXPECT_EQ(trace.size(), 1U);
    EXPECT_EQ(scheduler.step(1), Progress::kWorking);
    EXPECT_EQ(trace.size(), 2U);
    EXPECT_EQ(scheduler.statistics().largest_slice_units, 100U);
    EXPECT_EQ(scheduler.statistics().largest_overdraw_units, 90U);
    EXPECT_EQ(scheduler.step(1), Progress::kWorking);
    task.add_job({85});
    EXPECT_EQ(scheduler.step(10), Progress::kWorking);  // owes 75
    EXPECT_EQ(trace.size(), 4U);
    EXPECT_EQ(scheduler.statistics().largest_slice_units, 100U) << "the largest so far";
    EXPECT_EQ(scheduler.statistics().largest_overdraw_units, 90U);
}

// Promise: the hash sees each unit granted and each unit spent, and reset makes it as new.
TEST(Scheduler, HashAndReset) {
    std::vector<int> trace;
    StepTask task(1, trace);
    Scheduler scheduler;
    scheduler.create(10);
    scheduler.add(task);
    const std::uint64_t fresh = hash_of(scheduler);
    static_cast<void>(scheduler.step(1));
    const std::uint64_t granted = hash_of(scheduler);
    EXPECT_NE(granted, fresh);
    scheduler.reset();
    EXPECT_EQ(hash_of(scheduler), fresh);
    task.add_job({1});
    static_cast<void>(scheduler.step(1));
    EXPECT_NE(hash_of(scheduler), granted) << "one was idle, one worked";
}

// A task that claims to work and counts nothing.
class FreeTask final : public Task {
public:
    Progress step(WorkBudget&) noexcept override { return Progress::kDone; }
};

// Promise: a task that counts no units cannot hold the engine for ever.
TEST(Scheduler, WorkThatCountsNothingEnds) {
    FreeTask task;
    Scheduler scheduler;
    scheduler.create(10);
    scheduler.add(task);
    EXPECT_EQ(scheduler.step(1000), Progress::kWorking);
    EXPECT_EQ(scheduler.statistics().slices, 1000U);
}

// A task that spends and says that it was idle.
class LyingTask final : public Task {
public:
    Progress step(WorkBudget& budget) noexcept override {
        budget.spend(1);
        return Progress::kIdle;
    }
};

// Promise: our bugs stop the program: too many tasks, slices of nothing, idle tasks that spend.
TEST(SchedulerDeathTest, Checks) {
    FreeTask task;
    Scheduler scheduler;
    scheduler.create(1);
    EXPECT_DEATH(scheduler.create(0), "slice_units > 0");
    for (std::uint32_t i = 0; i < Scheduler::kTasksMax; ++i) scheduler.add(task);
    EXPECT_DEATH(scheduler.add(task), "tasks_count_ < kTasksMax");
    LyingTask liar;
    scheduler.create(1);
    scheduler.add(liar);
    EXPECT_DEATH(static_cast<void>(scheduler.step(1)), "units_spent\\(\\) == 0");
}

}  // namespace
}  // namespace stillmesh::scheduler_test
