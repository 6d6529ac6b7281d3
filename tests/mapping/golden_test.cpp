#include <gtest/gtest.h>

#include <cstdint>
#include <vector>

#include "engine/base/hash.hpp"
#include "tests/loop_closing/ring.hpp"
#include "tests/support/map_hash.hpp"
#include "tests/support/synthetic.hpp"

namespace stillmesh::golden_test {
namespace {

using test::Ring;

Vector6 small(Random& random, double size) {
    Vector6 out;
    for (int i = 0; i < 6; ++i) out(i) = random.uniform(-size, size);
    return out;
}

// The n-th keyframe of a way, a second after the one before, of a camera that turns behind a rolling shutter.
Handle<Keyframe> add_keyframe(Ring& ring, std::uint32_t n, Random& random) {
    const Handle<Keyframe> out = ring.add_keyframe(n);
    ring.world().clock.frame = 20 * n;
    ring.world().clock.time_ns = std::int64_t{1'000'000'000} * n;
    Map& map = ring.map();
    Keyframe& keyframe = *map.keyframes().find(out);
    keyframe.time_ns = ring.world().clock.time_ns;
    keyframe.speed = small(random, 1);
    keyframe.pose_by_readout = small(random, 0.5);
    keyframe.readout_s = map.readout_s();
    for (const Observation& seen : map.observations(out)) {
        MapPoint& point = *map.points().find(seen.point);
        if (random.below(50) == 0) point.is_suspect = true;
        if (random.below(50) == 0) point.world[0] += 0.3;
        store(small(random, 0.1).head<3>(), point.world_by_readout);
    }
    if (random.below(3) == 0) map.express_with_readout(map.readout_s() + random.uniform(-0.002, 0.002));
    return out;
}

// All that waits, in slices; what each took.
template <typename Job>
void work(Job& job, std::uint32_t slice_units, StateHash& hash) {
    for (;;) {
        WorkBudget budget(slice_units);
        if (job.step(budget) == Progress::kIdle) return;
        hash.add(budget.units_spent());
        hash.add(static_cast<std::uint32_t>(job.stage()));
    }
}

void add(const World& world, StateHash& hash) {
    const MappingStatistics& s = world.statistics.mapping;
    for (const std::uint64_t count : {s.keyframes_inserted, s.adjustments, s.adjustments_dropped, s.adjustment_slices,
                                      s.adjustment_iterations, s.observations_found, s.observations_dropped}) {
        hash.add(count);
    }
    const LoopStatistics& loop = world.statistics.loop;
    for (const std::uint64_t count : {loop.adjustments, loop.adjustments_dropped, loop.adjustment_iterations}) {
        hash.add(count);
    }
    hash.add(world.corrections);
    for (int i = 0; i < 3; ++i) hash.add(world.camera_move.correction.translation(i));
    hash.add(world.map.changes_hash());
    hash.add(test::map_hash(world.map, world.camera));
}

// Promise: windows, fusion, the room that is made and refinement give the same bits on every processor, compiler and
// optimisation level, for the same work: with a shutter that rolls, what moves, outliers, and keyframes that leave
// while they wait.
TEST(Mapping, GoldenBits) {
    StateHash hash;
    std::uint64_t dropped = 0, moved = 0;
    for (std::uint32_t round = 0; round < 3; ++round) {
        Parameters configuration = test::configuration_of_ring();
        configuration.mapping.window_keyframes = 4 + 4 * round;
        configuration.mapping.settled_s = round == 1 ? 3.5 : 1000;
        Ring ring(configuration);
        World& world = ring.world();
        Random random(round);
        world.noise = {1.3, 0.8};
        for (std::uint32_t i = 0; i < 30; ++i) {
            const Handle<Keyframe> made = add_keyframe(ring, i, random);
            ASSERT_TRUE(world.keyframe_queue.push(made));
            WorkBudget some(150);
            static_cast<void>(ring.mapping().step(some));
            hash.add(some.units_spent());
            if (round == 2 && i % 9 == 8) world.map.release_keyframe(i % 2 == 0 ? made : world.map.recent_keyframe(2));
            if (round == 2 && i % 7 == 6) world.move_everything(SE3{});
            work(ring.mapping(), 200 + 700 * round, hash);
            if (i < 2) continue;
            const Handle<Keyframe> before = world.map.recent_keyframe(2);
            for (std::uint32_t k = 0; k < world.map.observations(before).size(); k += 3) {
                hash.add(ring.mapping().fusion().fuse_into(world.map.observations(before)[k].point, made));
            }
            add(world, hash);
        }
        ++world.loops_closed;
        for (std::uint32_t slice = 0; slice < 6; ++slice) {
            WorkBudget budget(3000);
            static_cast<void>(ring.refinement().step(budget));
            hash.add(budget.units_spent());
        }
        static_cast<void>(add_keyframe(ring, 30, random));
        if (round == 1) ++world.loops_closed;
        work(ring.refinement(), 2000, hash);
        add(world, hash);
        dropped += world.statistics.mapping.observations_dropped;
        moved += world.corrections;
    }
    EXPECT_GT(dropped, 0U);
    EXPECT_GE(moved, 6U);
    EXPECT_EQ(hash.value(), 0xa079ad61f744321bULL) << std::hex << hash.value();
}

}  // namespace
}  // namespace stillmesh::golden_test
