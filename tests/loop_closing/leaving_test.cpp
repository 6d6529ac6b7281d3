#include <gtest/gtest.h>

#include <cstdint>
#include <memory>
#include <utility>
#include <vector>

#include "engine/loop_closing/loop_closing.hpp"
#include "tests/loop_closing/ring.hpp"
#include "tests/support/map_fault.hpp"

namespace stillmesh::leaving_test {
namespace {

using test::kLap;
using test::Ring;
using Stage = LoopClosing::Stage;

constexpr std::uint32_t kMadeMax = kLap + 12;

// Makes keyframes, from the half of the lap on in the smallest slices, until loop closing is about to do a stage.
bool go_to(Ring& ring, Stage stage, std::uint32_t& made) {
    while (made < kMadeMax) {
        static_cast<void>(ring.add_keyframe(made++));
        if (made < kLap / 2) {
            ring.work(100'000);
            continue;
        }
        for (;;) {
            WorkBudget budget(1);
            if (ring.loops().step(budget) == Progress::kIdle) break;
            if (ring.loops().stage() == stage) return true;
        }
        ring.work(100'000);
    }
    return false;
}

// Of each keyframe but the newest all work is done, so this is the one that is looked up.
Handle<Keyframe> looked_up(Ring& ring) {
    return ring.map().recent_keyframe(1);
}

void go_home(Ring& ring, std::uint32_t made) {
    ring.work(500);
    while (made < kMadeMax) {
        static_cast<void>(ring.add_keyframe(made++));
        ring.work(100'000);
    }
}

// Promise: a keyframe that leaves while it is looked up, or whose search a lost camera takes over, is dropped and
// counted; those after it find the way home.
TEST(LoopClosingLeaving, ASearchMayEndAtAnyStage) {
    for (const Stage stage : {Stage::kQuery, Stage::kChoose, Stage::kPrepare, Stage::kVerify}) {
        for (const bool is_overtaken : {false, true}) {
            auto ring = std::make_unique<Ring>();
            std::uint32_t made = 0;
            ASSERT_TRUE(go_to(*ring, stage, made)) << static_cast<int>(stage);
            ASSERT_EQ(ring->statistics().dropped, 0U);
            if (is_overtaken) {
                ring->places().take(PlaceSearch::User::kRelocalisation);
            } else {
                ring->map().release_keyframe(looked_up(*ring));
            }
            ring->work(500);
            EXPECT_EQ(ring->statistics().dropped, 1U) << static_cast<int>(stage);
            EXPECT_EQ(ring->loops().stage(), Stage::kIdle);
            go_home(*ring, made);
            EXPECT_EQ(ring->statistics().dropped, 1U) << static_cast<int>(stage);
            EXPECT_GE(ring->statistics().closed, 1U) << static_cast<int>(stage);
            EXPECT_EQ(test::find_fault(ring->map()), nullptr) << test::find_fault(ring->map());
        }
    }
}

// Promise: a place that leaves while it is verified is refused as gone.
TEST(LoopClosingLeaving, APlaceThatLeavesIsGone) {
    auto ring = std::make_unique<Ring>();
    std::uint32_t made = 0;
    ASSERT_TRUE(go_to(*ring, Stage::kVerify, made));
    const std::uint64_t before = ring->statistics().refused_gone;
    ring->map().release_keyframe(ring->places().verifier().candidate());
    ring->work(500);
    EXPECT_EQ(ring->statistics().refused_gone, before + 1);
    EXPECT_EQ(test::find_fault(ring->map()), nullptr) << test::find_fault(ring->map());
}

// Promise: a loop one end of which left before its graph was made closed nothing, and is not said to have; one that
// leaves later changes nothing of what was found.
TEST(LoopClosingLeaving, AnEndOfTheLoopMayLeave) {
    for (const bool is_place : {false, true}) {
        for (const Stage stage :
             {Stage::kBuild, Stage::kSolve, Stage::kCommit, Stage::kFuseMatches, Stage::kFuseNeighbours}) {
            auto ring = std::make_unique<Ring>();
            std::uint32_t made = 0;
            ASSERT_TRUE(go_to(*ring, stage, made)) << static_cast<int>(stage);
            const double before_m = stage <= Stage::kCommit ? ring->off_m() : 1;
            const Handle<Keyframe> leaves = is_place ? ring->places().verifier().candidate() : looked_up(*ring);
            ASSERT_NE(ring->map().keyframes().find(leaves), nullptr);
            ring->map().release_keyframe(leaves);
            ring->work(500);
            EXPECT_EQ(ring->loops().stage(), Stage::kIdle);
            const bool is_closed = stage != Stage::kBuild;
            EXPECT_EQ(ring->statistics().closed, is_closed ? 1U : 0U) << static_cast<int>(stage) << is_place;
            EXPECT_EQ(ring->world().loops_closed, ring->statistics().closed);
            EXPECT_EQ(ring->statistics().dropped, is_closed ? 0U : 1U);
            if (is_closed) {
                EXPECT_LT(ring->off_m(), 0.5 * before_m) << static_cast<int>(stage) << is_place;
            }
            EXPECT_EQ(test::find_fault(ring->map()), nullptr) << test::find_fault(ring->map());
        }
    }
}

// Promise: where matches are fused, a feature that has lost its point sees the place's; a point that is suspect or that
// many see stays its own; what has left the place is not waited for; and what is one already is not made one again.
TEST(LoopClosingLeaving, WhatIsThereIsFused) {
    std::vector<std::uint64_t> fused, found;
    for (const int change : {0, 1, 2, 3, 4}) {
        auto ring = std::make_unique<Ring>();
        std::uint32_t made = 0;
        ASSERT_TRUE(go_to(*ring, Stage::kFuseMatches, made));
        const LoopStatistics before = ring->statistics();
        for (const PlaceMatch& match : ring->places().verifier().agreeing()) {
            const Handle<MapPoint> own = ring->map().observations(looked_up(*ring))[match.feature].point;
            if (change == 1 && ring->map().points().find(own) != nullptr) ring->map().release_point(own);
            if (change == 2 && ring->map().points().find(own) != nullptr)
                ring->map().points().find(own)->is_suspect = true;
            if (change == 4 && ring->map().points().find(own) != nullptr) {
                ring->map().release_point(own);
                ASSERT_TRUE(ring->map().link(looked_up(*ring), match.feature, match.point));
            }
            if (change == 3 && ring->map().points().find(match.point) != nullptr)
                ring->map().release_point(match.point);
        }
        while (ring->loops().stage() == Stage::kFuseMatches) {
            WorkBudget budget(1);
            static_cast<void>(ring->loops().step(budget));
        }
        fused.push_back(ring->statistics().points_fused - before.points_fused);
        found.push_back(ring->statistics().observations_found - before.observations_found);
        EXPECT_EQ(test::find_fault(ring->map()), nullptr) << test::find_fault(ring->map());
    }
    EXPECT_GT(fused[0], 20U);
    EXPECT_EQ(found[0], 0U);
    EXPECT_EQ(fused[1], 0U) << "their points had left";
    EXPECT_GE(found[1], fused[0]);
    EXPECT_EQ(fused[2] + found[2] + fused[3] + found[3] + fused[4] + found[4], 0U);
}

// Promise: in a map that is only localised in, what is there is known for a lost camera at once, however young, and
// nothing is searched or moved.
TEST(LoopClosingLeaving, AFrozenMapKnowsItsPlaces) {
    Parameters configuration = test::configuration_of_ring();
    configuration.weights.proven_s = 0.7;  // its clock stands still
    auto ring = std::make_unique<Ring>(configuration);
    ring->world().is_frozen = true;
    for (std::uint32_t i = 0; i < kLap + 4; ++i) {
        const Handle<Keyframe> handle = ring->add_keyframe(i);
        EXPECT_FALSE(ring->places().has(handle));
        ring->work(5000);
        if (i > 0) {
            EXPECT_TRUE(ring->places().has(looked_up(*ring))) << i;
        }
    }
    EXPECT_EQ(ring->statistics().queries, 0U);
    EXPECT_EQ(ring->statistics().closed, 0U);
}

// Promise: of keyframes that wait the oldest is looked up first, wherever it lies.
TEST(LoopClosingLeaving, TheOldestComesFirst) {
    for (const bool is_downwards : {false, true}) {
        auto ring = std::make_unique<Ring>();
        std::uint32_t made = 0;
        for (; made < 10; ++made) {
            static_cast<void>(ring->add_keyframe(made));
            ring->work(100'000);
        }
        std::vector<Handle<Keyframe>> waiting{ring->add_keyframe(made), ring->add_keyframe(made + 1)};
        made += 2;
        if (is_downwards) {  // as where slots are taken again: the older lies behind the younger
            std::swap(ring->map().keyframes().find(waiting[0])->frame, ring->map().keyframes().find(waiting[1])->frame);
            std::swap(waiting[0], waiting[1]);
        }
        static_cast<void>(ring->add_keyframe(made));
        for (std::size_t known = 0; known < waiting.size();) {
            WorkBudget budget(1);
            ASSERT_NE(ring->loops().step(budget), Progress::kIdle);
            while (known < waiting.size() && ring->places().has(waiting[known])) ++known;
            for (std::size_t i = known; i < waiting.size(); ++i) ASSERT_FALSE(ring->places().has(waiting[i])) << i;
        }
    }
}

}  // namespace
}  // namespace stillmesh::leaving_test
