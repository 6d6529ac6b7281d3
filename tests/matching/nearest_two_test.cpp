#include "engine/matching/nearest_two.hpp"

#include <gtest/gtest.h>

#include <algorithm>
#include <cstdint>
#include <utility>
#include <vector>

#include "engine/base/random.hpp"

namespace stillmesh::nearest_two_test {
namespace {

// Promise: the nearest and the next are those that sorting all candidates puts first, of equals the first offered;
// what is farther than a match may be counts as one bit farther than that.
TEST(NearestTwo, IsWhatSortingFinds) {
    Random random(1);
    for (int round = 0; round < 2000; ++round) {
        const std::uint32_t distance_max = 1 + random.below(256);
        const std::uint32_t spread = 1 + random.below(257);  // small: many equals
        NearestTwo<std::uint32_t> two{distance_max};
        std::vector<std::pair<std::uint32_t, std::uint32_t>> candidates;
        const std::uint32_t count = random.below(12);
        for (std::uint32_t i = 0; i < count; ++i) {
            const std::uint32_t distance = random.below(spread);
            two.offer(distance, i);
            candidates.emplace_back(std::min(distance, distance_max + 1), i);
        }
        std::stable_sort(candidates.begin(), candidates.end(),
                         [](const auto& a, const auto& b) { return a.first < b.first; });
        const bool is_any = !candidates.empty() && candidates[0].first <= distance_max;
        ASSERT_EQ(two.is_any(), is_any);
        if (!is_any) continue;
        ASSERT_EQ(two.best, candidates[0].first);
        ASSERT_EQ(two.nearest, candidates[0].second);
        const bool has_next = candidates.size() > 1 && candidates[1].first <= distance_max;
        ASSERT_EQ(two.second, has_next ? candidates[1].first : distance_max + 1);
        if (has_next && candidates[1].first > candidates[0].first) {
            // Of equals for the second place any may stand there.
            std::uint32_t at = 0;
            for (const auto& [distance, i] : candidates) at = i == two.next ? distance : at;
            ASSERT_EQ(at, candidates[1].first);
        }
    }
}

// Promise: clear is a first that is at most the given share of the second, the bound included; a lone candidate is
// measured against one just beyond a match.
TEST(NearestTwo, IsClearByRatio) {
    struct Case {
        std::vector<std::uint32_t> distances;
        double ratio_max;
        bool is_clear;
    };
    for (const Case& c : {Case{{10, 20}, 0.5, true}, Case{{20, 10}, 0.5, true}, Case{{11, 20}, 0.5, false},
                          Case{{30, 30}, 1.0, true}, Case{{30, 30}, 0.99, false}, Case{{50}, 0.8, true},
                          Case{{53}, 0.8, false}, Case{{50, 250}, 0.8, true}, Case{{0, 0}, 0.1, true}}) {
        NearestTwo<int> two{64};
        for (const std::uint32_t distance : c.distances) two.offer(distance, 0);
        ASSERT_TRUE(two.is_any());
        EXPECT_EQ(two.is_clear(c.ratio_max), c.is_clear) << c.distances[0] << " " << c.ratio_max;
    }
}

}  // namespace
}  // namespace stillmesh::nearest_two_test
