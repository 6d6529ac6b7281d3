#include "engine/loop_closing/loop_closing.hpp"

#include <gtest/gtest.h>

#include <cmath>
#include <cstdint>
#include <map>
#include <memory>
#include <utility>
#include <vector>

#include "tests/loop_closing/ring.hpp"
#include "tests/support/map_fault.hpp"

namespace stillmesh::loop_closing_test {
namespace {

using test::configuration_of_ring;
using test::kLap;
using test::Ring;

// Promise: coming home after a lap closes the loop once, and lists it from then on between the place and the keyframe
// that found it; takes the drift away, makes duplicates one, moves the camera
// with the newest keyframe and gives the jump to map_from_odom alone; what the map keeps incrementally stays right.
TEST(LoopClosing, ComingHomeTakesTheDriftAway) {
    auto ring = std::make_unique<Ring>();
    double before = 0;
    std::vector<KeyframeLink> loops(2);
    bool was_pending = false;
    for (std::uint32_t i = 0; i < kLap + 10; ++i) {
        static_cast<void>(ring->add_keyframe(i));
        before = std::max(before, ring->off_m());
        const SE3 newest_before = ring->newest();
        const SE3 camera_before = ring->camera();
        while (ring->work(2000, 1) != 0) {
            was_pending = was_pending || ring->loops().stage() == LoopClosing::Stage::kSolve;
            ASSERT_EQ(ring->loops().list_loops(loops), ring->statistics().closed) << i;
        }
        // Whenever the map moved, the camera did what the newest keyframe did.
        const SE3 left = ring->newest() * newest_before.inverse() * camera_before;
        const SE3 camera = ring->camera();
        EXPECT_LT((camera.translation - left.translation).squaredNorm(), 1e-20) << i;
        EXPECT_LT((camera.rotation - left.rotation).squaredNorm(), 1e-20) << i;
    }
    const double camera_jumped_m = std::sqrt(ring->camera().translation.squaredNorm());
    const PoseEstimate& pose = ring->given_out();
    double odometry_jumped_m = 0, map_jumped_m = 0;
    for (int k = 0; k < 3; ++k) {
        odometry_jumped_m += std::abs(pose.odom_from_camera.translation_m[k]);
        map_jumped_m += std::abs(pose.map_from_odom.translation_m[k]);
    }
    EXPECT_GT(camera_jumped_m, 0.05);
    EXPECT_GE(map_jumped_m, camera_jumped_m * 0.99);
    EXPECT_LT(odometry_jumped_m, 1e-9);
    const LoopStatistics s = ring->statistics();
    std::printf(
        "off %.3f m before, %.3f m after; correction %.3f m, fused %llu, candidates %llu; refused: matches %llu, pose "
        "%llu, inliers %llu, spread %llu, far %llu, unlikely %llu\n",
        before, ring->off_m(), s.largest_correction_m, static_cast<unsigned long long>(s.points_fused),
        static_cast<unsigned long long>(s.candidates), static_cast<unsigned long long>(s.refused_matches),
        static_cast<unsigned long long>(s.refused_pose), static_cast<unsigned long long>(s.refused_inliers),
        static_cast<unsigned long long>(s.refused_spread), static_cast<unsigned long long>(s.refused_far),
        static_cast<unsigned long long>(s.refused_unlikely));
    EXPECT_EQ(s.closed, 1U);
    EXPECT_TRUE(was_pending);
    EXPECT_EQ(loops[0].older_id, ring->world().last_loop.frame_old);
    EXPECT_EQ(loops[0].newer_id, ring->world().last_loop.frame_new);
    EXPECT_GT(before, 0.1);
    EXPECT_LT(ring->off_m(), 0.25 * before);
    EXPECT_GT(s.largest_correction_m, 0.1);
    EXPECT_GT(s.points_fused, 30U);
    EXPECT_EQ(test::find_fault(ring->map()), nullptr) << test::find_fault(ring->map());
}

// Promise: any slicing gives the same map, and no slice goes beyond its budget by more than the stated ceiling.
TEST(LoopClosing, AnySlicingGivesTheSameBits) {
    std::vector<std::uint64_t> wanted;
    for (const std::uint32_t slice : {1'000'000U, 1U, 777U}) {
        auto ring = std::make_unique<Ring>();
        std::vector<std::uint64_t> hashes;
        for (std::uint32_t i = 0; i < kLap + 10; ++i) {
            static_cast<void>(ring->add_keyframe(i));
            ring->work(slice);
            hashes.push_back(ring->map().changes_hash());
        }
        hashes.push_back(ring->statistics().closed);
        if (wanted.empty()) wanted = hashes;
        ASSERT_EQ(hashes, wanted) << slice;
        EXPECT_EQ(ring->statistics().closed, 1U);
    }
}

// Promise: keyframes made while the graph is being solved follow their parent; those that leave meanwhile do no harm.
TEST(LoopClosing, TheMapMayChangeMeanwhile) {
    auto ring = std::make_unique<Ring>();
    std::uint32_t made = 0;
    Random random(3);
    while (ring->loops().stage() != LoopClosing::Stage::kSolve && made < kLap + 12) {
        static_cast<void>(ring->add_keyframe(made++));
        for (int i = 0; i < 20000 && ring->loops().stage() != LoopClosing::Stage::kSolve; ++i) {
            WorkBudget budget(100);
            if (ring->loops().step(budget) == Progress::kIdle) break;
        }
    }
    ASSERT_EQ(ring->loops().stage(), LoopClosing::Stage::kSolve);
    const double before = ring->off_m();
    const Handle<Keyframe> new_one = ring->add_keyframe(made++);
    for (int i = 0; i < 6; ++i) {
        const std::uint32_t slot = 5 + random.below(20);
        if (ring->map().keyframes().is_taken(slot))
            ring->map().release_keyframe(ring->map().keyframes().handle_of(slot));
    }
    ring->work(500);
    EXPECT_EQ(ring->statistics().closed, 1U);
    EXPECT_EQ(test::find_fault(ring->map()), nullptr) << test::find_fault(ring->map());
    EXPECT_LT(ring->off_m(), 0.4 * before);
    ASSERT_NE(ring->map().keyframes().find(new_one), nullptr);
    const Vector3 off =
        ring->map().keyframes().find(new_one)->world_from_camera.translation - ring->truth(made - 1).translation;
    EXPECT_LT(std::sqrt(off.squaredNorm()), 0.1);
}

// Promise: whatever leaves the map at whatever moment, nothing breaks and no fault is left behind.
TEST(LoopClosing, AnythingMayLeaveAtAnyTime) {
    std::uint32_t left_while_searching = 0, left_while_moving = 0;
    std::uint64_t closed = 0;
    for (std::uint64_t seed = 1; seed <= 6; ++seed) {
        auto ring = std::make_unique<Ring>();
        Random random(seed);
        for (std::uint32_t i = 0; i < kLap + 12; ++i) {
            static_cast<void>(ring->add_keyframe(i));
            for (int round = 0; round < 6; ++round) {
                ring->work(30, i < kLap ? 0 : 1 + random.below(40));
                const LoopClosing::Stage stage = ring->loops().stage();
                // A map that is being moved is a rare sight.
                const bool is_moving = stage >= LoopClosing::Stage::kBuild;
                if (i < kLap || (!is_moving && random.below(4) != 0)) continue;
                const std::uint32_t slot = random.below(static_cast<std::uint32_t>(kLap));
                if (!ring->map().keyframes().is_taken(slot)) continue;
                ring->map().release_keyframe(ring->map().keyframes().handle_of(slot));
                if (is_moving) {
                    ++left_while_moving;
                } else if (stage != LoopClosing::Stage::kIdle) {
                    ++left_while_searching;
                }
            }
        }
        ring->work(1000);
        EXPECT_EQ(test::find_fault(ring->map()), nullptr) << test::find_fault(ring->map());
        closed += ring->statistics().closed;
    }
    // It was not all over when they left.
    EXPECT_GE(left_while_searching, 3U);
    EXPECT_GE(left_while_moving, 3U);
    EXPECT_GE(closed, 3U);
}

// Promise: a place farther than odometry can have drifted is none, however alike; nor one farther than the distance
// limit; nor one that fewer queries agree on than asked. Without a vocabulary, or switched off, there is no work at
// all.
TEST(LoopClosing, RefusesWhatCannotBe) {
    const auto go = [](Parameters configuration, bool has_vocabulary, std::uint32_t keyframes) {
        auto ring = std::make_unique<Ring>(configuration, has_vocabulary);
        for (std::uint32_t i = 0; i < keyframes; ++i) {
            static_cast<void>(ring->add_keyframe(i));
            ring->work(100'000);
        }
        return ring->statistics();
    };
    Parameters configuration = configuration_of_ring();
    configuration.loop.drift_m = 0;
    configuration.loop.drift_share = 0;
    auto ring = std::make_unique<Ring>(configuration);
    for (std::uint32_t i = 0; i < kLap + 10; ++i) {
        const Handle<Keyframe> handle = ring->add_keyframe(i);
        ring->map().keyframes().find(handle)->drift_m = 0.001F * static_cast<float>(i);
        ring->work(100'000);
    }
    EXPECT_GT(ring->statistics().refused_unlikely, 0U);
    EXPECT_EQ(ring->statistics().closed, 0U);

    configuration = configuration_of_ring();
    configuration.loop.distance_max_m = 0.01;
    LoopStatistics s = go(configuration, true, kLap + 10);
    EXPECT_EQ(s.closed, 0U);
    EXPECT_GT(s.refused_far, 0U);

    configuration = configuration_of_ring();
    configuration.loop.consistency = 0;
    const std::uint64_t at_once = go(configuration, true, kLap).candidates;
    EXPECT_GT(at_once, go(configuration_of_ring(), true, kLap).candidates);

    EXPECT_EQ(go(configuration_of_ring(), false, kLap + 10).queries, 0U);
    configuration = configuration_of_ring();
    configuration.loop.is_enabled = false;
    EXPECT_EQ(go(configuration, true, kLap + 10).queries, 0U);
}

// Promise: without drift a place is confirmed, and the map stays where it is.
TEST(LoopClosing, ConfirmsWhereNothingDrifted) {
    auto ring = std::make_unique<Ring>(configuration_of_ring(), true, false);
    for (std::uint32_t i = 0; i < kLap + 10; ++i) {
        static_cast<void>(ring->add_keyframe(i));
        ring->work(5000);
    }
    const LoopStatistics s = ring->statistics();
    EXPECT_EQ(s.closed, 0U);
    EXPECT_EQ(s.confirmed, 1U);
    std::vector<KeyframeLink> loops(2);
    EXPECT_EQ(ring->loops().list_loops(loops), 1U);
    EXPECT_LT(ring->off_m(), 1e-9);
}

// Promise: what verification cannot tell from no drift at all is confirmed, however many millimetres it says: the map
// knows better. (A place seen by some points far away was "corrected" by 2.3 cm with a deviation of 2.)
TEST(LoopClosing, WhatIsWithinItsNoiseIsNoDrift) {
    Parameters configuration = configuration_of_ring();
    configuration.loop.correction_min_m = 0.0005;
    const auto go = [&](double chi2_min) {
        configuration.loop.correction_chi2_min = chi2_min;
        auto ring = std::make_unique<Ring>(configuration, true, false, 0.001);
        for (std::uint32_t i = 0; i < kLap + 10; ++i) {
            static_cast<void>(ring->add_keyframe(i));
            ring->work(5000);
        }
        return std::pair(ring->statistics(), ring->off_m());
    };
    const auto [held, held_off_m] = go(LoopParameters().correction_chi2_min);
    EXPECT_EQ(held.closed, 0U);
    EXPECT_EQ(held.confirmed, 1U);
    EXPECT_LT(held_off_m, 1e-9);
    const auto [moved, moved_off_m] = go(0);  // the same place, taken at its word
    EXPECT_EQ(moved.closed, 1U);
    EXPECT_GT(moved_off_m, 0.001);
}

// Promise: a turn is drift, too, though the camera stands where the map has it: it is taken away where odometry can
// have turned so far, and a place that wants a larger one is none, however alike.
TEST(LoopClosing, ATurnIsDriftToo) {
    for (const double turned_rad : {0.1, 0.8}) {
        Parameters configuration = configuration_of_ring();
        configuration.loop.correction_min_m = 0.09;
        configuration.loop.drift_m = 0.9;
        configuration.loop.consistency = 1;
        auto ring = std::make_unique<Ring>(configuration, true, false);
        for (std::uint32_t i = 0; i < kLap + 6; ++i) {
            const Handle<Keyframe> handle = ring->add_keyframe(i);
            if (i + 8 == kLap) {  // slipped as it came home
                SE3& pose = ring->map().keyframes().find(handle)->world_from_camera;
                pose.rotation = pose.rotation * so3_exp(Vector3(0, turned_rad, 0));
            }
            ring->work(5000);
        }
        const LoopStatistics s = ring->statistics();
        const bool can_be = turned_rad < 0.5;
        const double off_rad = rotation_angle(ring->truth(kLap + 5).rotation.transpose() * ring->newest().rotation);
        EXPECT_EQ(s.closed, can_be ? 1U : 0U) << turned_rad << ": " << s.candidates << " candidates, " << s.confirmed;
        EXPECT_EQ(s.refused_unlikely > 0, !can_be) << turned_rad;
        if (can_be) {
            EXPECT_LT(off_rad, 0.2 * turned_rad);
        } else {
            EXPECT_NEAR(off_rad, turned_rad, 1e-6);
        }
    }
}

// Promise: nothing is looked up, and no place known, before what a keyframe saw has had the time to prove that it
// stands.
TEST(LoopClosing, WaitsUntilThePastHasSpoken) {
    Parameters configuration = configuration_of_ring();
    configuration.weights.proven_s = 0.7;
    auto ring = std::make_unique<Ring>(configuration, true, false);  // its clock stands still
    for (std::uint32_t i = 0; i < kLap + 10; ++i) {
        static_cast<void>(ring->add_keyframe(i));
        ring->work(5000);
    }
    EXPECT_EQ(ring->statistics().queries, 0U);
    EXPECT_EQ(ring->statistics().confirmed, 0U);
}

// Promise: reset() forgets everything, also in the middle of a loop: the same lap gives the same map again.
TEST(LoopClosing, ResetForgets) {
    auto used = std::make_unique<Ring>();
    std::uint32_t made = 0;
    while (used->loops().stage() < LoopClosing::Stage::kBuild && made < kLap + 12) {
        static_cast<void>(used->add_keyframe(made++));
        for (int i = 0; i < 20000 && used->loops().stage() < LoopClosing::Stage::kBuild; ++i) {
            if (used->work(100, 1) == 0) break;
        }
    }
    ASSERT_GE(used->loops().stage(), LoopClosing::Stage::kBuild);
    used->forget();
    EXPECT_EQ(used->statistics().queries, 0U);
    EXPECT_EQ(used->loops().stage(), LoopClosing::Stage::kIdle);
    auto fresh = std::make_unique<Ring>();
    for (std::uint32_t i = 0; i < kLap + 10; ++i) {
        for (Ring* const ring : {used.get(), fresh.get()}) {
            static_cast<void>(ring->add_keyframe(i));
            ring->work(5000);
        }
        ASSERT_EQ(used->map().changes_hash(), fresh->map().changes_hash()) << i;
    }
    EXPECT_EQ(used->statistics().closed, 1U);
    EXPECT_EQ(used->statistics().queries, fresh->statistics().queries);
    EXPECT_EQ(used->statistics().candidates, fresh->statistics().candidates);
}

}  // namespace
}  // namespace stillmesh::loop_closing_test
