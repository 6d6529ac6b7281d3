#include "engine/tasks/mapping.hpp"

#include <gtest/gtest.h>

#include <algorithm>
#include <cstdint>
#include <vector>

#include "platform/linux/cpu_kernels.hpp"
#include "tests/support/frames.hpp"
#include "tests/support/memory.hpp"

namespace stillmesh {
namespace {

Limits limits_of(std::uint32_t keyframes, std::uint32_t points) {
    Limits limits = Limits::tiny();
    limits.keyframes_max = keyframes;
    limits.map_points_max = points;
    return limits;
}

Configuration fitting(const Limits& limits) {
    Configuration out;
    out.mapping.is_fusing = true;  // everything there is
    out.mapping.is_triangulating = true;
    out.features.count = limits.features_max;
    out.features.levels = limits.pyramid_levels_max;
    out.keyframes.gap_min = 3;
    out.keyframes.new_points_min = 10;
    return out;
}

// Tracking and mapping, with their map open to the eye.
class Rig {
public:
    Rig(const CameraModel& camera, const Limits& limits, const Configuration& configuration)
        : memory_(planned(limits)) {
        Arena arena(memory_.span());
        tracking_.create(arena, limits, configuration, camera, cpu_kernels(), nullptr);
        mapping_.create(arena, limits, configuration, camera, tracking_);
        EXPECT_EQ(arena.used_bytes(), memory_.span().size());
    }
    Tracking& tracking() { return tracking_; }
    Mapping& mapping() { return mapping_; }
    // Everything that waits, in slices.
    void work(std::uint32_t slice_units) {
        for (;;) {
            WorkBudget budget(slice_units);
            const Progress progress = mapping_.step(budget);
            EXPECT_LE(budget.units_spent(), std::uint64_t{slice_units} + mapping_.piece_units_max());
            if (progress == Progress::kIdle) {
                EXPECT_EQ(budget.units_spent(), 0U);
                return;
            }
            EXPECT_GT(budget.units_spent(), 0U);
            ++slices;
        }
    }
    std::uint64_t slices = 0;

private:
    static std::size_t planned(const Limits& limits) {
        ArenaPlan plan;
        Tracking::plan(plan, limits);
        Mapping::plan(plan, limits);
        return plan.used_bytes();
    }
    test::Memory memory_;
    Tracking tracking_;
    Mapping mapping_;
};

const test::Sequence& sequence() {
    static const test::Sequence kept = test::rendered("walking_xyz", 80, 160, 120, 2);
    return kept;
}

// Promise: any slicing of mapping gives the same poses, the same map and the same hash; no slice goes beyond its budget
// by more than the stated ceiling; what is kept incrementally stays right; everything is done at least once.
TEST(Mapping, AnySlicingGivesTheSameBits) {
    const Limits limits = limits_of(8, 300);
    std::vector<std::uint64_t> wanted;
    for (const std::uint32_t slice : {1'000'000U, 1U, 7U, 400U}) {
        Rig rig(sequence().camera, limits, fitting(limits));
        std::vector<std::uint64_t> hashes;
        for (const test::KeptFrame& kept : sequence().frames) {
            rig.tracking().track(kept.frame());
            ASSERT_EQ(rig.tracking().map().find_fault(), nullptr) << rig.tracking().map().find_fault();
            rig.work(slice);
            ASSERT_EQ(rig.tracking().map().find_fault(), nullptr) << rig.tracking().map().find_fault();
            hashes.push_back(rig.tracking().state_hash());
            hashes.push_back(rig.tracking().map().changes_hash());
        }
        if (wanted.empty()) wanted = hashes;
        ASSERT_EQ(hashes, wanted) << "slices of " << slice;
        EngineStatistics statistics;
        rig.mapping().fill(statistics);
        rig.tracking().fill(statistics);
        EXPECT_GT(statistics.mapping.keyframes_inserted, 5U);
        EXPECT_GT(statistics.mapping.adjustments, 3U);
        EXPECT_GT(statistics.mapping.adjustment_iterations, statistics.mapping.adjustments);
        EXPECT_GT(statistics.mapping.observations_found, 0U);
        EXPECT_GT(statistics.points_evicted, 0U);
        EXPECT_GT(statistics.keyframes_forgotten, 0U);
        EXPECT_EQ(statistics.keyframes_refused, 0U);
        if (slice == 1) {
            EXPECT_GT(rig.slices, 1000U);
        }
    }
}

// Promise: the n-th take fails, for keyframes n = 2, 3, ... and points from the fewest that are allowed: tracking goes
// on with mapping at work, the map stays right, and the pools never hold more than they may.
TEST(Mapping, EveryPoolMayBeFull) {
    for (std::uint32_t keyframes = 2; keyframes <= 9; ++keyframes) {
        const Limits limits = limits_of(keyframes, 100 + 25 * (keyframes - 2));
        Rig rig(sequence().camera, limits, fitting(limits));
        std::uint32_t measured = 0;
        for (const test::KeptFrame& kept : sequence().frames) {
            rig.tracking().track(kept.frame());
            measured += rig.tracking().pose().state >= PoseState::kUnsure ? 1U : 0U;
            // Sometimes mapping is late.
            if (kept.time_ns % 3 != 0) rig.work(300);
            ASSERT_EQ(rig.tracking().map().find_fault(), nullptr) << rig.tracking().map().find_fault();
        }
        // A hundred points in a crowd are few: it may be lost, and then it says so.
        EXPECT_GE(measured, sequence().frames.size() / (keyframes < 4 ? 5 : 2)) << keyframes;
        EXPECT_LE(rig.tracking().map().keyframes().high_water(), keyframes);
    }
}

// Promise: without mapping's turn the queue fills, what does not fit is counted, and tracking goes on making room
// itself.
TEST(Mapping, WithoutUnitsTrackingGoesOn) {
    const Limits limits = limits_of(4, 150);
    Rig rig(sequence().camera, limits, fitting(limits));
    std::uint32_t keyframes = 0;
    for (const test::KeptFrame& kept : sequence().frames) {
        rig.tracking().track(kept.frame());
        keyframes += rig.tracking().frame_statistics().is_keyframe ? 1U : 0U;
        ASSERT_EQ(rig.tracking().map().find_fault(), nullptr);
    }
    EngineStatistics statistics;
    rig.tracking().fill(statistics);
    EXPECT_EQ(statistics.keyframe_queue.size, Tracking::kQueueMax);
    EXPECT_EQ(statistics.keyframes_refused, keyframes - Tracking::kQueueMax);
    // Those that waited may be gone by now: they are passed over.
    rig.work(50);
    EXPECT_EQ(rig.tracking().map().find_fault(), nullptr);
    EXPECT_TRUE(rig.tracking().keyframe_queue().is_empty());
}

// Promise: after reset a rig does what a new one does, also in the middle of an adjustment.
TEST(Mapping, ResetEqualsNew) {
    const Limits limits = limits_of(8, 300);
    Rig used(sequence().camera, limits, fitting(limits));
    for (std::size_t i = 0; i < 30; ++i) {
        used.tracking().track(sequence().frames[i].frame());
        WorkBudget budget(900);  // less than there is to do
        static_cast<void>(used.mapping().step(budget));
    }
    used.tracking().reset();
    used.mapping().reset();
    Rig fresh(sequence().camera, limits, fitting(limits));
    for (std::size_t i = 0; i < 40; ++i) {
        for (Rig* const rig : {&used, &fresh}) {
            rig->tracking().track(sequence().frames[i].frame());
            rig->work(777);
        }
        ASSERT_EQ(used.tracking().state_hash(), fresh.tracking().state_hash()) << i;
    }
}

}  // namespace
}  // namespace stillmesh
