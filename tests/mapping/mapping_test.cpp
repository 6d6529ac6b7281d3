#include "engine/mapping/mapping.hpp"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <cstdint>
#include <utility>
#include <vector>

#include "engine/tracking/tracking.hpp"
#include "platform/linux/cpu_kernels.hpp"
#include "tests/support/frames.hpp"
#include "tests/support/map_fault.hpp"
#include "tests/support/memory.hpp"

namespace stillmesh::mapping_test {
namespace {

Limits limits_of(std::uint32_t keyframes, std::uint32_t points) {
    Limits limits = Limits::tiny();
    limits.keyframes_max = keyframes;
    limits.map_points_max = points;
    return limits;
}

Parameters fitting(const Limits& limits) {
    Parameters out;
    out.features.count = limits.features_max;
    out.features.levels = limits.pyramid_levels_max;
    out.mapping.window_keyframes = std::min(out.mapping.window_keyframes, limits.keyframes_max);
    out.keyframes.gap_min = 3;
    out.keyframes.new_points_min = 10;
    return out;
}

// Tracking and mapping, with their map open to the eye.
class Rig {
public:
    Rig(const CameraModel& camera, const Limits& limits, const Parameters& configuration) : memory_(planned(limits)) {
        Arena arena(memory_.span());
        world_.create(arena, limits, configuration, camera);
        tracking_.create(arena, world_, cpu_kernels(), nullptr);
        mapping_.create(arena, world_);
        EXPECT_EQ(arena.used_bytes(), memory_.span().size());
    }
    World& world() { return world_; }
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
        World::plan(plan, limits);
        Tracking::plan(plan, limits);
        Mapping::plan(plan, limits);
        return plan.used_bytes();
    }
    test::Memory memory_;
    World world_;
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
            ASSERT_EQ(test::find_fault(rig.world().map), nullptr) << test::find_fault(rig.world().map);
            rig.work(slice);
            ASSERT_EQ(test::find_fault(rig.world().map), nullptr) << test::find_fault(rig.world().map);
            hashes.push_back(rig.tracking().state_hash());
            hashes.push_back(rig.world().map.changes_hash());
        }
        if (wanted.empty()) wanted = hashes;
        ASSERT_EQ(hashes, wanted) << "slices of " << slice;
        const EngineStatistics statistics = rig.world().all_statistics();
        EXPECT_GT(statistics.mapping.keyframes_inserted, 5U);
        EXPECT_GT(statistics.mapping.adjustments, 3U);
        EXPECT_GT(statistics.mapping.adjustment_iterations, statistics.mapping.adjustments);
        EXPECT_GT(statistics.points_evicted, 0U);
        EXPECT_GT(statistics.keyframes_forgotten, 0U);
        EXPECT_EQ(statistics.keyframes_refused, 0U);
        if (slice == 1) {
            EXPECT_GT(rig.slices, 1000U);
        }
    }
}

// Promise: a new keyframe that sees too few points of the map stays where tracking put it, and the camera with it,
// however many its neighbours see; one that sees enough is adjusted.
TEST(Mapping, AFewPointsMoveNoCamera) {
    const Limits limits = limits_of(8, 300);
    const Parameters configuration = fitting(limits);
    Rig rig(sequence().camera, limits, configuration);
    Map& map = rig.world().map;
    const auto adjustments = [&rig] { return rig.world().statistics.mapping.adjustments; };
    std::uint32_t held = 0;
    std::uint32_t adjusted = 0;
    for (const test::KeptFrame& kept : sequence().frames) {
        rig.tracking().track(kept.frame());
        if (rig.world().keyframe_queue.is_empty()) continue;
        const Handle<Keyframe> newest = map.recent_keyframe(0);
        std::uint32_t shared = 0;
        for (const Observation& o : map.observations(newest)) {
            const MapPoint* const point = map.points().find(o.point);
            shared += point != nullptr && !point->is_suspect && point->observers >= 2 ? 1U : 0U;
        }
        const Vector3 keyframe_at = map.keyframes().find(newest)->world_from_camera.translation;
        const Vector3 camera_at = rig.tracking().world_from_camera().translation;
        const std::uint64_t before = adjustments();
        rig.work(1'000'000);
        // And a neighbour that sees enough of the same.
        std::uint32_t neighbours = 0;
        for (std::uint32_t slot = 0; slot < map.keyframes().slots_count(); ++slot) {
            if (slot == newest.slot() || !map.keyframes().is_taken(slot)) continue;
            neighbours += map.shared(newest.slot(), slot) >= configuration.map.shared_min ? 1U : 0U;
        }
        const bool is_enough = neighbours > 0 && shared >= configuration.pose.sure_inliers();
        ASSERT_EQ(adjustments() - before, is_enough ? 1U : 0U) << shared << " points";
        if (is_enough) {
            ++adjusted;
        } else {
            ++held;
            EXPECT_EQ(map.keyframes().find(newest)->world_from_camera.translation, keyframe_at);
            EXPECT_EQ(rig.tracking().world_from_camera().translation, camera_at);
        }
    }
    EXPECT_GE(adjusted, 3U);
    EXPECT_GE(held, 3U);
}

// Promise: an adjustment bends nothing: where a point's reference keyframe is turned, what the readout does to the
// point and to its anchor turns with it.
TEST(Mapping, WhatTheReadoutDoesTurnsWithTheKeyframe) {
    const Limits limits = limits_of(8, 300);
    Rig rig(sequence().camera, limits, fitting(limits));
    Map& map = rig.world().map;
    struct Before {
        Handle<MapPoint> point;
        Handle<Keyframe> reference;
        Matrix3 rotation;
    };
    const Vector3 by_readout(0.2, -0.1, 0.3);
    std::uint32_t turned = 0;
    for (const test::KeptFrame& kept : sequence().frames) {
        rig.tracking().track(kept.frame());
        if (rig.world().keyframe_queue.is_empty()) continue;
        std::vector<Before> before;
        for (std::uint32_t slot = 0; slot < map.points().slots_count(); ++slot) {
            if (!map.points().is_taken(slot) || map.points().at(slot).reference.is_null()) continue;
            MapPoint& point = map.points().at(slot);
            store(by_readout, point.world_by_readout);
            store(by_readout, point.anchor_by_readout);
            const Matrix3 rotation = map.keyframes().find(point.reference)->world_from_camera.rotation;
            before.push_back({map.points().handle_of(slot), point.reference, rotation});
        }
        rig.work(1'000'000);
        for (const Before& was : before) {
            const MapPoint* const point = map.points().find(was.point);
            const Keyframe* const keyframe = map.keyframes().find(was.reference);
            if (point == nullptr || keyframe == nullptr || !(point->reference == was.reference)) continue;
            const Matrix3 turn = keyframe->world_from_camera.rotation * was.rotation.transpose();
            turned += rotation_angle(turn) > 1e-4 ? 1U : 0U;
            const Vector3 expected = turn * by_readout;
            ASSERT_LT((vector_of(point->world_by_readout) - expected).norm(), 1e-6);
            ASSERT_LT((vector_of(point->anchor_by_readout) - expected).norm(), 1e-6);
        }
    }
    EXPECT_GT(turned, 100U);
}

// Promise: an adjustment counts as dropped when it had been started, not when its keyframe leaves the map, or the whole
// map is corrected, before; then nothing of it is left behind.
TEST(Mapping, OnlyWhatWasStartedIsDropped) {
    using Stage = Mapping::Stage;
    for (const bool is_corrected : {false, true}) {
        std::uint32_t before_start = 0, after_start = 0;
        for (const Stage until : {Stage::kChoose, Stage::kCollect, Stage::kAdjust, Stage::kCommit}) {
            const Limits limits = limits_of(8, 300);
            Rig rig(sequence().camera, limits, fitting(limits));
            Map& map = rig.world().map;
            for (const test::KeptFrame& kept : sequence().frames) {
                rig.tracking().track(kept.frame());
                if (rig.world().keyframe_queue.is_empty()) continue;
                const Handle<Keyframe> at_hand = rig.world().keyframe_queue[0];
                Progress progress = Progress::kWorking;
                while (progress == Progress::kWorking && rig.mapping().stage() != until) {
                    WorkBudget budget(1);
                    progress = rig.mapping().step(budget);
                }
                if (rig.mapping().stage() != until) continue;
                const EngineStatistics then = rig.world().statistics;
                if (is_corrected) {
                    rig.world().move_everything(SE3{});
                } else {
                    map.release_keyframe(at_hand);
                }
                WorkBudget budget(1000);
                EXPECT_EQ(rig.mapping().step(budget), Progress::kDone);
                EXPECT_LT(budget.units_spent(), 1000U) << "what it does not need others may have";
                const EngineStatistics& now = rig.world().statistics;
                const bool is_started = until == Stage::kAdjust || until == Stage::kCommit;
                EXPECT_EQ(now.mapping.adjustments_dropped - then.mapping.adjustments_dropped, is_started ? 1U : 0U)
                    << static_cast<int>(until);
                EXPECT_LE(now.mapping.adjustments_dropped, now.mapping.adjustments);
                EXPECT_EQ(test::find_fault(map), nullptr) << test::find_fault(map);
                ++(is_started ? after_start : before_start);
                break;
            }
        }
        EXPECT_EQ(before_start, 2U);
        EXPECT_EQ(after_start, 2U);
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
            measured += rig.world().pose.state >= PoseState::kUnsure ? 1U : 0U;
            // Sometimes mapping is late.
            if (kept.time_ns % 3 != 0) rig.work(300);
            ASSERT_EQ(test::find_fault(rig.world().map), nullptr) << test::find_fault(rig.world().map);
        }
        // A hundred points in a crowd are few: it may be lost, and then it says so.
        EXPECT_GE(measured, sequence().frames.size() / (keyframes < 4 ? 5 : 2)) << keyframes;
        EXPECT_LE(rig.world().map.keyframes().high_water(), keyframes);
    }
}

// Promise: after each keyframe room is made ahead of need in full pools: one keyframe of 64 and at least one, and
// points for a frame or a sixth of the pool, whichever is less; where there is room nothing goes.
TEST(Mapping, MakesRoomAheadOfNeed) {
    for (const std::uint32_t keyframes : {3U, 64U, 127U, 128U, 200U}) {
        for (const std::uint32_t points : {300U, 900U}) {
            const Limits limits = limits_of(keyframes, points);
            const std::uint32_t keyframes_spare = std::max(keyframes / 64, 1U);
            const std::uint32_t points_spare = std::min(limits.features_max, points / 6);
            for (const std::uint32_t free : {0U, 1U, keyframes_spare, keyframes_spare + 1}) {
                Rig rig(sequence().camera, limits, fitting(limits));
                Map& map = rig.world().map;
                rig.world().clock.frame = 1000;
                for (std::uint32_t i = 0; i + free < keyframes; ++i) {
                    Keyframe& keyframe = *map.keyframes().find(map.add_keyframe());
                    keyframe.frame = i + 1;
                    keyframe.world_from_camera.translation.x() = 10.0 * i;
                }
                const std::uint32_t points_free = free == 0 ? 0 : points_spare + free - 2;
                for (std::uint32_t i = 0; i + points_free < points; ++i)
                    map.points().find(map.add_point().value())->seen = 20;
                ASSERT_TRUE(rig.world().keyframe_queue.push(map.recent_keyframe(0)));
                rig.work(1'000'000);
                EXPECT_EQ(keyframes - map.keyframes().size(), std::max(free, keyframes_spare)) << keyframes << free;
                EXPECT_EQ(points - map.points().size(), std::max(points_free, points_spare)) << points << free;
            }
        }
    }
}

// Takes all but `left` points of the pool, for good: nobody forgets what was seen in the far future.
std::vector<Handle<MapPoint>> rob(Map& map, std::size_t left) {
    std::vector<Handle<MapPoint>> taken;
    while (map.points().capacity() - map.points().size() > left) {
        taken.push_back(map.add_point().value());
        map.points().find(taken.back())->last_seen_frame = std::uint64_t{1} << 38U;
    }
    return taken;
}

// Promise: the n-th take of a point by a keyframe fails, n = 1, 2, 3, ...: the engine tracks on or says that it does
// not, the map stays right, and once there is room again it is used.
TEST(Mapping, EveryTakeOfAPointMayFail) {
    const Limits limits = limits_of(6, 300);
    const test::Sequence still = test::rendered("static_xyz", 50, 160, 120);
    for (std::uint32_t left = 0; left <= 120; left += left < 16 ? 1 : 8) {
        Rig rig(still.camera, limits, fitting(limits));
        Map& map = rig.world().map;
        std::vector<Handle<MapPoint>> robbed = rob(map, left);
        std::uint32_t measured_later = 0, refusals_said = 0;
        const std::size_t rich_from = 26;
        for (std::size_t i = 0; i < still.frames.size(); ++i) {
            if (i == rich_from) {
                for (const Handle<MapPoint> point : robbed) map.release_point(point);
            }
            const test::KeptFrame& kept = still.frames[i];
            rig.tracking().track(kept.frame());
            rig.work(i % 3 == 0 ? 300 : 5000);
            const PoseEstimate& pose = rig.world().pose;
            for (const double t : pose.odom_from_camera.translation_m) ASSERT_TRUE(std::isfinite(t));
            if (i < rich_from) {
                ASSERT_LE(map.points().size(), map.points().capacity());
                // Fewer points than a pose takes: no pose is measured, and it says so.
                if (left < fitting(limits).pose.inliers_min && i > 0) {
                    ASSERT_LE(pose.state, PoseState::kPredicted) << left << " points, frame " << i;
                    ++refusals_said;
                }
            } else {
                measured_later += pose.state >= PoseState::kUnsure ? 1U : 0U;
            }
            ASSERT_EQ(test::find_fault(map), nullptr)
                << test::find_fault(map) << ", " << left << " points, frame " << i;
        }
        // Some dozens carry it through; fewer, and it stays lost, since who is lost makes no keyframe.
        if (left >= 64) {
            EXPECT_GT(measured_later, 20U) << left;
        }
        if (left < 90) {
            EXPECT_GT(map.points().refused(), 0U) << left;
        }
        EXPECT_EQ(refusals_said, left < fitting(limits).pose.inliers_min ? rich_from - 1 : 0U);
    }
}

// Promise: every other limit may be as small as can be named: groups, points of the local map, levels, features with
// what follows from them (points and observations of an adjustment; more keyframes than its window), keyframes.
TEST(Mapping, EveryLimitMayBeSmall) {
    const Limits tiny = limits_of(8, 300);
    std::vector<std::pair<const char*, Limits>> cases;
    for (std::uint32_t n = 1; n <= 5; ++n) {
        cases.emplace_back("groups", tiny).second.groups_max = n;
        cases.emplace_back("local points", tiny).second.local_points_max = n * n * n;
        cases.emplace_back("keyframes", tiny).second.keyframes_max = n + 1;
        if (n <= 2) cases.emplace_back("levels", tiny).second.pyramid_levels_max = n;
        Limits& few = cases.emplace_back("features", limits_of(40, 2000)).second;
        few.features_max = 45 + 5 * n;
    }
    for (const auto& [name, limits] : cases) {
        Rig rig(sequence().camera, limits, fitting(limits));
        for (std::size_t i = 0; i < 40; ++i) {
            rig.tracking().track(sequence().frames[i].frame());
            rig.work(1000);
            const Map& map = rig.world().map;
            ASSERT_EQ(test::find_fault(map), nullptr) << test::find_fault(map) << ", " << name << ", frame " << i;
            ASSERT_LE(rig.world().local_map.points().size(), limits.local_points_max) << name;
            for (const double t : rig.world().pose.odom_from_camera.translation_m) ASSERT_TRUE(std::isfinite(t));
        }
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
        ASSERT_EQ(test::find_fault(rig.world().map), nullptr);
    }
    const EngineStatistics statistics = rig.world().all_statistics();
    EXPECT_EQ(statistics.keyframe_queue.size, World::kKeyframeQueueMax);
    EXPECT_EQ(statistics.keyframes_refused, keyframes - World::kKeyframeQueueMax);
    // Those that waited may be gone by now: they are passed over.
    rig.work(50);
    EXPECT_EQ(test::find_fault(rig.world().map), nullptr);
    EXPECT_TRUE(rig.world().keyframe_queue.is_empty());
    EXPECT_EQ(rig.world().all_statistics().keyframe_queue.size, 0U);
    EXPECT_EQ(rig.world().all_statistics().keyframe_queue.high_water, World::kKeyframeQueueMax) << "at most, not now";
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
    used.world().reset();
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
}  // namespace stillmesh::mapping_test
