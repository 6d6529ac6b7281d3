#include "engine/base/numbers.hpp"

#include <gtest/gtest.h>

#include <bit>
#include <cmath>
#include <cstdint>
#include <limits>
#include <set>
#include <vector>

#include "engine/base/hash.hpp"
#include "engine/base/random.hpp"

namespace stillmesh::numbers_test {
namespace {

constexpr double kNan = std::numeric_limits<double>::quiet_NaN();
constexpr double kInfinity = std::numeric_limits<double>::infinity();

std::int32_t clamp_like_the_book(double value, std::int32_t low, std::int32_t high) {
    if (std::isnan(value)) return low;
    if (value <= low) return low;
    if (value >= high) return high;
    return static_cast<std::int32_t>(value);
}

// Promise: rounding and flooring agree with the C library wherever that is defined, and are clamped elsewhere.
TEST(Numbers, AgreeWithTheLibrary) {
    Random random(1);
    for (int i = 0; i < 500'000; ++i) {
        double value = 0;
        switch (i % 4) {
            case 0: value = random.uniform(-1000, 1000); break;
            case 1: value = std::bit_cast<double>(random.next()); break;  // any bits: NaN, infinities, subnormals
            case 2: value = 0.5 * static_cast<double>(static_cast<std::int64_t>(random.below(4000)) - 2000); break;
            default: value = random.uniform(-4.3e9, 4.3e9);
        }
        ASSERT_EQ(round_clamped(value), clamp_like_the_book(std::round(value), INT32_MIN, INT32_MAX)) << value;
        ASSERT_EQ(floor_clamped(value), clamp_like_the_book(std::floor(value), INT32_MIN, INT32_MAX)) << value;
        ASSERT_EQ(round_clamped(value, -7, 100), clamp_like_the_book(std::round(value), -7, 100)) << value;
        ASSERT_EQ(floor_clamped(value, 0, 639), clamp_like_the_book(std::floor(value), 0, 639)) << value;
    }
}

// Promise: the corners are as the comments say: halves away from zero, NaN to the lower bound, no overflow anywhere.
TEST(Numbers, Corners) {
    static_assert(round_clamped(2.5) == 3 && round_clamped(-2.5) == -3 && round_clamped(-0.4) == 0);
    static_assert(floor_clamped(-0.5) == -1 && floor_clamped(0.999) == 0 && floor_clamped(-3.0) == -3);
    EXPECT_EQ(round_clamped(0.49999999999999994), 0);
    EXPECT_EQ(round_clamped(kNan), INT32_MIN);
    EXPECT_EQ(floor_clamped(kNan, -5, 5), -5);
    EXPECT_EQ(round_clamped(kInfinity, -5, 5), 5);
    EXPECT_EQ(round_clamped(-kInfinity, -5, 5), -5);
    EXPECT_EQ(round_clamped(2147483646.5), INT32_MAX);
    EXPECT_EQ(round_clamped(-2147483647.5), INT32_MIN);
    EXPECT_EQ(floor_clamped(2147483646.9), 2147483646);
    EXPECT_EQ(round_clamped_64(9.3e18), INT64_MAX);
    EXPECT_EQ(round_clamped_64(-9.3e18), INT64_MIN);
    EXPECT_EQ(round_clamped_64(kNan), INT64_MIN);
    EXPECT_EQ(round_clamped_64(1305031102175303936.0, 0), 1305031102175303936);
    EXPECT_EQ(round_clamped_64(-1.5), -2);
    EXPECT_EQ(round_clamped_64(4503599627370497.5), 4503599627370498);
}

// Promise: the state hash of a given sequence of fields is this number on every processor and compiler.
TEST(StateHash, Golden) {
    StateHash hash;
    EXPECT_EQ(hash.value(), 0xefd01f60ba992926ULL);
    hash.add(std::uint64_t{0x0123456789abcdefULL});
    hash.add(std::int64_t{-1});
    hash.add(std::uint32_t{7});
    hash.add(std::int32_t{-7});
    hash.add(1.25);
    hash.add(-0.0F);
    EXPECT_EQ(hash.value(), 0xd643895a803bbc38ULL);
}

// Promise: one bit of one field, or the order of two fields, changes the hash.
TEST(StateHash, SeesEveryBitAndTheOrder) {
    std::set<std::uint64_t> seen;
    for (int field = 0; field < 3; ++field) {
        for (int bit = 0; bit < 64; ++bit) {
            StateHash hash;
            for (int i = 0; i < 3; ++i) hash.add(i == field ? std::uint64_t{1} << bit : std::uint64_t{0});
            EXPECT_TRUE(seen.insert(hash.value()).second) << field << " " << bit;
        }
    }
    StateHash ab;
    ab.add(1.0);
    ab.add(2.0);
    StateHash ba;
    ba.add(2.0);
    ba.add(1.0);
    EXPECT_NE(ab.value(), ba.value());
    StateHash plus;
    plus.add(0.0);
    StateHash minus;
    minus.add(-0.0);
    EXPECT_NE(plus.value(), minus.value());
}

// Promise: the random numbers are SplitMix64's (published sequence of seed 1234567).
TEST(Random, IsSplitMix64) {
    Random random(1234567);
    EXPECT_EQ(random.next(), 6457827717110365317ULL);
    EXPECT_EQ(random.next(), 3203168211198807973ULL);
    EXPECT_EQ(random.next(), 9817491932198370423ULL);
    EXPECT_EQ(random.next(), 4593380528125082431ULL);
    EXPECT_EQ(random.next(), 16408922859458223821ULL);
}

// Promise: below(n) reaches each of its n values about equally often and none beyond.
TEST(Random, BelowIsUniform) {
    Random random(5);
    for (const std::uint32_t bound : {1U, 2U, 3U, 10U, 97U}) {
        std::vector<int> counts(bound, 0);
        const int draws = 2000 * static_cast<int>(bound);
        for (int i = 0; i < draws; ++i) ++counts.at(random.below(bound));
        double chi2 = 0;
        for (const int count : counts) chi2 += (count - 2000.0) * (count - 2000.0) / 2000.0;
        const double freedom = bound - 1;
        EXPECT_LE(chi2, freedom + 5 * std::sqrt(2 * freedom) + 1e-9) << bound;
    }
}

// Promise: uniform() stays in [0, 1), normal() has mean 0 and variance 1, each within five standard errors.
TEST(Random, Moments) {
    Random random(6);
    const int n = 400'000;
    double uniform_sum = 0;
    double sum = 0;
    double sum2 = 0;
    for (int i = 0; i < n; ++i) {
        const double u = random.uniform();
        ASSERT_GE(u, 0.0);
        ASSERT_LT(u, 1.0);
        uniform_sum += u;
        const double g = random.normal();
        sum += g;
        sum2 += g * g;
    }
    EXPECT_NEAR(uniform_sum / n, 0.5, 5 * std::sqrt(1.0 / 12 / n));
    EXPECT_NEAR(sum / n, 0.0, 5 / std::sqrt(n));
    EXPECT_NEAR(sum2 / n, 1.0, 5 * std::sqrt(2.0 / n));
}

}  // namespace
}  // namespace stillmesh::numbers_test
