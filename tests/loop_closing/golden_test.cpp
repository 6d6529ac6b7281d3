#include <gtest/gtest.h>

#include <cstdint>
#include <vector>

#include "engine/base/hash.hpp"
#include "tests/loop_closing/ring.hpp"
#include "tests/support/map_hash.hpp"

namespace stillmesh::golden_test {
namespace {

using test::kLap;
using test::Ring;

void add(const LoopStatistics& s, StateHash& hash) {
    for (const std::uint64_t count :
         {s.queries, s.candidates, s.closed, s.confirmed, s.refused_matches, s.refused_pose, s.refused_inliers,
          s.refused_spread, s.refused_far, s.refused_unlikely, s.refused_gone, s.dropped, s.points_fused,
          s.observations_found, s.graph_iterations}) {
        hash.add(count);
    }
    hash.add(s.largest_correction_m);
    hash.add(s.last_correction_m);
}

// All that waits, in slices; what each took.
void work(Ring& ring, std::uint32_t slice_units, StateHash& hash) {
    for (;;) {
        WorkBudget budget(slice_units);
        if (ring.loops().step(budget) == Progress::kIdle) return;
        hash.add(budget.units_spent());
        hash.add(static_cast<std::uint32_t>(ring.loops().stage()));
    }
}

// Promise: laps with and without drift, searched eagerly and with care, among keyframes that leave, give the same bits
// on every processor, compiler and optimisation level, for the same work; so do the loops that are listed afterwards.
TEST(LoopClosing, GoldenBits) {
    StateHash hash;
    std::uint64_t closed = 0, confirmed = 0;
    for (std::uint32_t round = 0; round < 4; ++round) {
        Parameters configuration = test::configuration_of_ring();
        if (round == 1) configuration.loop.consistency = 1;
        if (round == 2) configuration.loop.score_share = 0.2;
        Ring ring(configuration, true, round != 3);
        Random random(round);
        for (std::uint32_t i = 0; i < kLap + 10; ++i) {
            static_cast<void>(ring.add_keyframe(i));
            work(ring, 90 + 400 * round, hash);
            Map& map = ring.map();
            if (round == 1 && i > 12 && random.below(6) == 0) map.release_keyframe(map.recent_keyframe(3));
            hash.add(map.changes_hash());
        }
        hash.add(test::map_hash(ring.map(), ring.world().camera));
        add(ring.statistics(), hash);
        std::vector<KeyframeLink> links(kLap);
        links.resize(ring.loops().list_loops(links));
        for (const KeyframeLink& link : links) {
            hash.add(link.older_id);
            hash.add(link.newer_id);
            hash.add(link.shared_points);
        }
        closed += ring.statistics().closed;
        confirmed += ring.statistics().confirmed;
    }
    EXPECT_GE(closed, 3U);
    EXPECT_GE(confirmed, 1U);
    EXPECT_EQ(hash.value(), 0x8dcb37ccc0ea1214ULL) << std::hex << hash.value();
}

}  // namespace
}  // namespace stillmesh::golden_test
