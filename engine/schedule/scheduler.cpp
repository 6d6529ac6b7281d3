#include "engine/schedule/scheduler.hpp"

namespace stillmesh {

void Scheduler::create(std::uint32_t slice_units) noexcept {
    STILLMESH_CHECK(slice_units > 0);
    tasks_ = {};
    tasks_count_ = last_ = 0;
    slice_units_ = slice_units;
    reset();
}

void Scheduler::add(Task& task) noexcept {
    last_ = tasks_count_;
    add_behind(task);
}

void Scheduler::add_behind(Task& task) noexcept {
    STILLMESH_CHECK(tasks_count_ < kTasksMax);
    tasks_[tasks_count_++] = {&task, 0};
}

void Scheduler::reset() noexcept {
    for (Entry& entry : tasks_) entry.units_spent = 0;
    debt_units_ = 0;
    statistics_ = {};
}

std::uint32_t Scheduler::slice(std::uint32_t units) noexcept {
    const bool is_turn_of_last = statistics_.units_spent / slice_units_ % kTurns == kTurns - 1;
    for (std::uint32_t n = 0; n < tasks_count_; ++n) {
        const std::uint32_t i = is_turn_of_last ? (n + last_) % tasks_count_ : n;
        WorkBudget budget(units);
        const Progress progress = tasks_[i].task->step(budget);
        if (progress == Progress::kIdle) {
            STILLMESH_CHECK(budget.units_spent() == 0);
            continue;
        }
        STILLMESH_CHECK(budget.units_spent() <= 0xffffffffU);
        // A step that counts nothing still took its turn: no grant lasts forever.
        const auto spent = budget.units_spent() > 0 ? static_cast<std::uint32_t>(budget.units_spent()) : 1U;
        tasks_[i].units_spent += spent;
        statistics_.units_spent += spent;
        ++statistics_.slices;
        if (spent > statistics_.largest_slice_units) statistics_.largest_slice_units = spent;
        if (spent > units && spent - units > statistics_.largest_overdraw_units) {
            statistics_.largest_overdraw_units = spent - units;
        }
        return spent;
    }
    return 0;
}

Progress Scheduler::step(std::uint32_t units) noexcept {
    ++statistics_.steps;
    statistics_.units_granted += units;
    if (units <= debt_units_) {  // 0 units too
        debt_units_ -= units;
        return Progress::kWorking;
    }
    std::uint32_t left = units - static_cast<std::uint32_t>(debt_units_);
    debt_units_ = 0;
    bool has_worked = false;
    while (left > 0) {
        const auto of_turn = static_cast<std::uint32_t>(slice_units_ - statistics_.units_spent % slice_units_);
        const std::uint32_t spent = slice(left < of_turn ? left : of_turn);
        if (spent == 0) {
            statistics_.units_lost += left;
            if (!has_worked) ++statistics_.steps_idle;
            return has_worked ? Progress::kDone : Progress::kIdle;
        }
        has_worked = true;
        debt_units_ = spent > left ? spent - left : 0;
        left = spent < left ? left - spent : 0;
    }
    return Progress::kWorking;
}

std::uint64_t Scheduler::units_spent_by(std::uint32_t task) const noexcept {
    STILLMESH_CHECK(task < tasks_count_);
    return tasks_[task].units_spent;
}

void Scheduler::add_to(StateHash& hash) const noexcept {
    hash.add(statistics_.units_granted);
    hash.add(debt_units_);
    std::uint64_t units_behind = 0;
    for (std::uint32_t i = last_ + 1; i < tasks_count_; ++i) units_behind += tasks_[i].units_spent;
    for (std::uint32_t i = 0; i < tasks_count_ && i <= last_; ++i) {
        hash.add(tasks_[i].units_spent + (i == last_ ? units_behind : 0));
    }
}

}  // namespace stillmesh
