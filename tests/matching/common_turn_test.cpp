#include "engine/matching/common_turn.hpp"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <cstdint>
#include <utility>
#include <vector>

#include "engine/base/random.hpp"

namespace stillmesh::common_turn_test {
namespace {

constexpr double kPi = 3.14159265358979323846;

// In which of 30 bins around multiples of 12 degrees.
int bin_of(float from, float to) {
    const double degrees = (static_cast<double>(to) - static_cast<double>(from)) * 180.0 / kPi;
    const int bin = static_cast<int>(std::floor(degrees / 12.0 + 0.5));
    return ((bin % 30) + 30) % 30;
}

// Promise: matches agree whose turn is in one of the fullest bins, but for bins far emptier than the first; counted
// here by sorting, for turns of any direction, over the border of the circle too.
TEST(CommonTurn, AgreesAsCountingSays) {
    Random random(2);
    for (int round = 0; round < 300; ++round) {
        CommonTurn turn;
        std::vector<std::pair<float, float>> matches;
        const double common = random.uniform(-kPi, kPi);
        const std::uint32_t count = random.below(200);
        std::vector<std::pair<int, int>> counts(30);  // minus the count, bin: sorted, the fullest and lowest first
        for (int bin = 0; bin < 30; ++bin) counts[static_cast<std::size_t>(bin)] = {0, bin};
        for (std::uint32_t i = 0; i < count; ++i) {
            const double from = random.uniform(-kPi, kPi);
            const double off = random.below(3) == 0 ? random.uniform(-kPi, kPi) : random.normal() * 0.1;
            const double to = std::remainder(from + common + off, 2.0 * kPi);
            matches.emplace_back(static_cast<float>(from), static_cast<float>(to));
            turn.add(matches.back().first, matches.back().second);
            --counts[static_cast<std::size_t>(bin_of(matches.back().first, matches.back().second))].first;
        }
        std::vector<int> ring(30);
        for (const auto& [negative, bin] : counts) ring[static_cast<std::size_t>(bin)] = -negative;
        std::sort(counts.begin(), counts.end());
        const std::uint32_t bins_max = 1 + random.below(6);
        turn.choose(bins_max);
        std::vector<bool> is_chosen(30);
        for (std::uint32_t rank = 0; rank < bins_max; ++rank) {
            const int of_bin = -counts[rank].first;
            if (of_bin == 0) break;
            is_chosen[static_cast<std::size_t>(counts[rank].second)] = true;
        }
        for (const auto& [from, to] : matches) {
            ASSERT_EQ(turn.has(from, to), is_chosen[static_cast<std::size_t>(bin_of(from, to))]) << from << " " << to;
        }
        int alike = 0;
        for (std::size_t i = 0; i < 30; ++i) {
            alike = std::max(alike, ring[i] + ring[(i + 1) % 30] + ring[(i + 2) % 30]);
        }
        EXPECT_EQ(static_cast<int>(turn.count_alike()), alike);
    }
}

// Promise: the same turn is the same bin however the two angles lie, and half a turn more is another one.
TEST(CommonTurn, ATurnIsATurn) {
    CommonTurn turn;
    turn.add(0.3F, 0.3F);
    turn.choose(1);
    for (const float angle : {-3.1F, -1.0F, 0.0F, 2.0F, 3.1F}) {
        EXPECT_TRUE(turn.has(angle, angle));
        EXPECT_TRUE(turn.has(angle, angle + 0.1F));
        EXPECT_TRUE(turn.has(angle, angle - 0.1F));
        EXPECT_FALSE(turn.has(angle, angle + 0.11F));
        EXPECT_FALSE(turn.has(angle, angle - 3.1F));
    }
    EXPECT_TRUE(turn.has(3.12F, -3.12F));  // three degrees, over the border
    EXPECT_EQ(turn.count_alike(), 1U);
}

// Promise: without matches nothing agrees.
TEST(CommonTurn, NothingAgreesWithNothing) {
    CommonTurn turn;
    turn.choose(3);
    EXPECT_FALSE(turn.has(0.0F, 0.0F));
    EXPECT_EQ(turn.count_alike(), 0U);
}

}  // namespace
}  // namespace stillmesh::common_turn_test
