// The maps of a run: no pose of one says where it lies in another, so that the error is that of the one with most
// poses.
#pragma once

#include <fmt/format.h>

#include <algorithm>
#include <cstddef>
#include <utility>

#include "platform/evaluation/trajectory.hpp"
#include "platform/report/run_record.hpp"

namespace stillmesh {

class MapsOfRun {
public:
    [[nodiscard]] std::size_t count() const { return count_; }
    void begin_another(RunRecord& record, std::size_t given) {
        keep(record, given);
        ++count_;
        begin_ = given;
        record.estimate.clear();
    }
    void finish(RunRecord& record, std::size_t given) {
        keep(record, given);
        record.estimate = std::move(most_);
        if (count_ > 1 && !record.estimate.empty()) {
            record.notes.push_back(
                fmt::format("{} maps; the error and the path shown are those of map {} alone.", count_, chosen_));
        }
    }
    // Of the poses given out, those in that map.
    [[nodiscard]] std::size_t final_begin() const { return chosen_begin_; }
    [[nodiscard]] std::size_t final_end() const { return chosen_end_; }

private:
    // Where there is a truth, what lies in its time counts.
    [[nodiscard]] static std::size_t worth_of(const RunRecord& record) {
        if (record.truth.empty()) return record.estimate.size();
        return static_cast<std::size_t>(
            std::count_if(record.estimate.begin(), record.estimate.end(), [&record](const TrajectoryPose& pose) {
                return pose.time_ns >= record.truth.front().time_ns && pose.time_ns <= record.truth.back().time_ns;
            }));
    }
    void keep(RunRecord& record, std::size_t given) {
        const std::size_t worth = worth_of(record);
        if (count_ > 1 && worth <= most_worth_) return;
        most_worth_ = worth;
        most_ = std::move(record.estimate);
        chosen_ = count_;
        chosen_begin_ = begin_;
        chosen_end_ = given;
    }

    std::size_t count_ = 1, begin_ = 0;
    std::size_t chosen_ = 1, chosen_begin_ = 0, chosen_end_ = 0, most_worth_ = 0;
    Trajectory most_;
};

}  // namespace stillmesh
