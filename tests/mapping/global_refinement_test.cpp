#include "engine/mapping/global_refinement.hpp"

#include <gtest/gtest.h>

#include <cstdint>
#include <memory>
#include <vector>

#include "tests/loop_closing/ring.hpp"
#include "tests/support/map_fault.hpp"

namespace stillmesh::global_refinement_test {
namespace {

using test::configuration_of_ring;
using test::Ring;

constexpr std::uint32_t kKeyframes = 24;

// Part of a lap with the drift of odometry in it, and a loop that says of itself that it was closed.
std::unique_ptr<Ring> drifted(const Parameters& configuration = configuration_of_ring()) {
    auto ring = std::make_unique<Ring>(configuration);
    for (std::uint32_t i = 0; i < kKeyframes; ++i) static_cast<void>(ring->add_keyframe(i));
    return ring;
}

// Steps until nothing waits, or until `stage` is reached.
void work(GlobalRefinement& refinement, std::uint32_t slice_units,
          GlobalRefinement::Stage until = GlobalRefinement::Stage::kIdle) {
    for (;;) {
        WorkBudget budget(slice_units);
        const Progress progress = refinement.step(budget);
        EXPECT_LE(budget.units_spent(), std::uint64_t{slice_units} + refinement.piece_units_max());
        if (progress == Progress::kIdle || (until != GlobalRefinement::Stage::kIdle && refinement.stage() == until)) {
            return;
        }
    }
}

// Promise: nothing happens until a loop was closed; then, once, the map becomes what the keyframes saw: most of the
// drift is gone. The first keyframe stays, the camera goes with the newest, what was adjusted before is void.
TEST(GlobalRefinement, TheMapBecomesWhatTheKeyframesSaw) {
    auto ring = drifted();
    GlobalRefinement& refinement = ring->refinement();
    WorkBudget budget(1000);
    ASSERT_EQ(refinement.step(budget), Progress::kIdle);
    const double before_m = ring->off_m();
    const SE3 newest_before = ring->newest();
    ASSERT_GT(before_m, 0.05);
    ++ring->world().loops_closed;
    work(refinement, 500);
    EXPECT_LT(ring->off_m(), 0.3 * before_m);
    EXPECT_EQ(ring->world().corrections, 1U);
    EXPECT_EQ(ring->world().loops_closed, 1U);
    EXPECT_EQ(ring->statistics().adjustments, 1U);
    EXPECT_EQ(ring->statistics().adjustments_dropped, 0U);
    EXPECT_GT(ring->statistics().adjustment_iterations, 1U);
    const SE3 moved = ring->newest() * newest_before.inverse();
    EXPECT_LT((ring->camera().translation - moved.translation).norm(), 1e-9);
    const Handle<Keyframe> first = ring->map().recent_keyframe(kKeyframes - 1);
    EXPECT_LT((ring->map().keyframes().find(first)->world_from_camera.translation - ring->truth(0).translation).norm(),
              1e-12);
    EXPECT_EQ(test::find_fault(ring->map()), nullptr) << test::find_fault(ring->map());
}

// Promise: any slicing gives the same map.
TEST(GlobalRefinement, AnySlicingGivesTheSameBits) {
    std::uint64_t wanted = 0;
    for (const std::uint32_t slice : {1'000'000U, 1U, 777U}) {
        auto ring = drifted();
        ++ring->world().loops_closed;
        work(ring->refinement(), slice);
        if (wanted == 0) wanted = ring->map().changes_hash();
        EXPECT_EQ(ring->map().changes_hash(), wanted) << slice;
    }
}

// Promise: another loop while it runs drops it, and it begins anew with the map as it is then; one before it has begun
// does not count as dropped.
TEST(GlobalRefinement, AnotherLoopBeginsItAnew) {
    auto ring = drifted();
    GlobalRefinement& refinement = ring->refinement();
    ring->world().loops_closed = 2;
    work(refinement, 100, GlobalRefinement::Stage::kAdjust);
    ASSERT_EQ(refinement.stage(), GlobalRefinement::Stage::kAdjust);
    EXPECT_EQ(ring->statistics().adjustments_dropped, 0U);
    ++ring->world().loops_closed;
    work(refinement, 100);
    EXPECT_EQ(ring->statistics().adjustments, 2U);
    EXPECT_EQ(ring->statistics().adjustments_dropped, 1U);
    EXPECT_EQ(ring->world().corrections, 1U);
}

// Promise: what tracking has followed since the copy was made stays beside its keyframe; a keyframe made since goes
// with its parent; whatever leaves does no harm.
TEST(GlobalRefinement, TheMapMayChangeMeanwhile) {
    for (std::uint64_t seed = 1; seed <= 4; ++seed) {
        auto ring = drifted();
        Random random(seed);
        Map& map = ring->map();
        GlobalRefinement& refinement = ring->refinement();
        ring->world().clock.frame = 20 * kKeyframes;
        ++ring->world().loops_closed;
        work(refinement, 100, GlobalRefinement::Stage::kAdjust);
        const Handle<Keyframe> made_since = ring->add_keyframe(kKeyframes);
        const Handle<Keyframe> parent = map.keyframes().find(made_since)->parent;
        for (int i = 0; i < 4; ++i) {
            const std::uint32_t slot = 1 + random.below(kKeyframes - 4);
            if (map.keyframes().is_taken(slot) && !(map.keyframes().handle_of(slot) == parent)) {
                map.release_keyframe(map.keyframes().handle_of(slot));
            }
        }
        // Points of a keyframe that stayed, followed since.
        struct Followed {
            Handle<MapPoint> point;
            Vector3 in_keyframe;
        };
        std::vector<Followed> followed;
        for (std::uint32_t slot = 0; slot < map.points().slots_count() && followed.size() < 50; slot += 7) {
            if (!map.points().is_taken(slot) || !(map.points().at(slot).reference == parent)) continue;
            MapPoint& point = map.points().at(slot);
            point.last_seen_frame = ring->world().clock.frame + 1;
            followed.push_back({map.points().handle_of(slot),
                                map.keyframes().find(parent)->world_from_camera.inverse() * vector_of(point.world)});
        }
        const SE3 between = map.keyframes().find(parent)->world_from_camera.inverse() *
                            map.keyframes().find(made_since)->world_from_camera;
        work(refinement, 500);
        EXPECT_EQ(ring->world().corrections, 1U);
        EXPECT_EQ(test::find_fault(map), nullptr) << test::find_fault(map);
        const SE3 parent_now = map.keyframes().find(parent)->world_from_camera;
        const SE3 between_now = parent_now.inverse() * map.keyframes().find(made_since)->world_from_camera;
        EXPECT_LT((between_now.translation - between.translation).norm(), 1e-9);
        ASSERT_GE(followed.size(), 3U);
        for (const Followed& one : followed) {
            const Vector3 now = parent_now.inverse() * vector_of(map.points().find(one.point)->world);
            EXPECT_LT((now - one.in_keyframe).norm(), 1e-9);
        }
    }
}

// Promise: switched off, it never begins; after reset() it waits for a new loop.
TEST(GlobalRefinement, MayBeSwitchedOffAndReset) {
    Parameters configuration = configuration_of_ring();
    configuration.loop.is_adjusting = false;
    auto off = drifted(configuration);
    ++off->world().loops_closed;
    WorkBudget budget(1000);
    EXPECT_EQ(off->refinement().step(budget), Progress::kIdle);
    EXPECT_EQ(off->statistics().adjustments, 0U);

    auto ring = drifted();
    ++ring->world().loops_closed;
    work(ring->refinement(), 100, GlobalRefinement::Stage::kAdjust);
    ring->forget();
    EXPECT_EQ(ring->refinement().stage(), GlobalRefinement::Stage::kIdle);
    EXPECT_EQ(ring->refinement().step(budget), Progress::kIdle);
    EXPECT_EQ(ring->statistics().adjustments, 0U);
}

}  // namespace
}  // namespace stillmesh::global_refinement_test
