// Work in slices. A task is given a budget in work units (one unit: one residual evaluated, or 32 descriptors compared;
// each task's header says what it counts), does a bounded piece, and says whether more is waiting. Units are counted,
// never read from a clock: the same units give the same bits on every machine.
#pragma once

#include <cstdint>

#include "engine/base/check.hpp"

namespace stillmesh {

// What is left of the units granted. A slice may overdraw by at most the ceiling its task states: work is not cut in
// the middle of a step.
class WorkBudget {
public:
    explicit constexpr WorkBudget(std::uint32_t units) noexcept : units_left_(units) {}
    constexpr void spend(std::uint32_t units) noexcept {
        spent_ += units;
        units_left_ = units < units_left_ ? units_left_ - units : 0;
    }
    [[nodiscard]] constexpr bool is_spent() const noexcept { return units_left_ == 0; }
    [[nodiscard]] constexpr std::uint64_t units_spent() const noexcept { return spent_; }

private:
    std::uint32_t units_left_ = 0;
    std::uint64_t spent_ = 0;
};

enum class Progress : std::uint8_t {
    kIdle = 0,     // nothing is waiting; nothing was spent
    kWorking = 1,  // the budget ended first; more is waiting
    kDone = 2,     // finished what it had taken up; more may be waiting
};

// The loop of a job that is done piece by piece: `piece` does the next one and returns its units, until it says that
// the job is_done() or the budget is spent.
template <typename Piece, typename IsDone>
[[nodiscard]] Progress work_in_pieces(WorkBudget& budget, std::uint64_t& units_of_job, Piece&& piece,
                                      IsDone&& is_done) noexcept {
    while (!budget.is_spent()) {
        const std::uint32_t units = piece();
        budget.spend(units);
        units_of_job += units;
        if (is_done()) return Progress::kDone;
    }
    return Progress::kWorking;
}

// A port (its body fails a CHECK: a pure virtual would pull the C++ runtime into the engine).
class Task {
public:
    // Works until the budget is spent or nothing is waiting. The result of a job does not depend on how it is cut.
    [[nodiscard]] virtual Progress step(WorkBudget& budget) noexcept {
        static_cast<void>(budget);
        check_failed("Task::step not implemented", __FILE__, __LINE__);
    }

protected:
    ~Task() = default;
};

}  // namespace stillmesh
