// Background work in the shadow of tracking, on the same thread: a few tasks in order of priority (mapping before loop
// closing, and the refinement of the whole map behind it), given work units by Engine::step. Tracking itself is no
// task: it runs to completion in Engine::submit, before any of this.
//
// The rule. Units are spent in turns of slice_units. Three turns of four begin with the first task that has work, the
// fourth with the last one, and after each slice, which ends with its turn at the latest, the search begins anew. What
// a task overdraws (at most the ceiling of one of its steps) is a debt, taken from the next grants; what no task needs
// is lost. Hence
//   - the same steps are done whether units are granted at once or in any parts: step(a), step(b) is step(a + b), as
//     long as nothing new arrives between the two;
//   - no task starves while units are granted, however tracking is loaded: of two tasks that always have work the first
//     gets three quarters and the last one quarter, but for what the steps of a turn overdraw. Without the quarter a
//     camera that keeps mapping busy looks up no places (corridor: 9 of 149 keyframes).
// Cost: nothing but the tasks' own; a few counters.
#pragma once

#include <array>
#include <cstdint>

#include "engine/base/hash.hpp"
#include "engine/schedule/task.hpp"

namespace stillmesh {

struct ScheduleStatistics {
    std::uint64_t steps = 0;       // calls
    std::uint64_t steps_idle = 0;  // of them, with nothing done because nothing was waiting
    std::uint64_t slices = 0;      // times a task was given a budget and used it
    std::uint64_t units_granted = 0;
    std::uint64_t units_spent = 0;
    std::uint64_t units_lost = 0;              // granted, and no task had work
    std::uint32_t largest_slice_units = 0;     // spent by one slice
    std::uint32_t largest_overdraw_units = 0;  // beyond the budget of a slice
};

class Scheduler {
public:
    static constexpr std::uint32_t kTasksMax = 4;
    static constexpr std::uint32_t kTurns = 4;  // one of so many begins with the last task

    // Forgets its tasks. `slice_units`: at least 1.
    void create(std::uint32_t slice_units) noexcept;
    // In order of priority, the first first. The task must outlive the scheduler.
    void add(Task& task) noexcept;
    // One that begins no turn: it gets what the task before it leaves, in every turn.
    void add_behind(Task& task) noexcept;
    // As after create and the same add() calls; the tasks are not touched.
    void reset() noexcept;

    // kIdle: nothing was waiting and nothing was done. kDone: all that was waiting has been finished.
    // kWorking: the units ended first (0 units, or units that only pay a debt, say so too).
    Progress step(std::uint32_t units) noexcept;

    [[nodiscard]] const ScheduleStatistics& statistics() const noexcept { return statistics_; }
    [[nodiscard]] std::uint64_t units_spent_by(std::uint32_t task) const noexcept;
    // Units granted, spent by each task, and owed: how far the work has come, whatever its slices were.
    void add_to(StateHash& hash) const noexcept;

private:
    struct Entry {
        Task* task = nullptr;
        std::uint64_t units_spent = 0;
    };
    // One slice for the first task that has work, in the order of this turn; 0: no task has.
    [[nodiscard]] std::uint32_t slice(std::uint32_t units) noexcept;

    std::array<Entry, kTasksMax> tasks_;
    std::uint32_t tasks_count_ = 0;
    std::uint32_t last_ = 0;  // begins every fourth turn: the last that was not added behind another
    std::uint32_t slice_units_ = 1;
    std::uint64_t debt_units_ = 0;
    ScheduleStatistics statistics_;
};

}  // namespace stillmesh
