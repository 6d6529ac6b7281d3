// The pair of words that counts for the checker on 32-bit processors.
#include "tests/mesh/wide.hpp"

#include <gtest/gtest.h>

#include <array>
#include <limits>

#include "engine/base/random.hpp"

namespace stillmesh::mesh_checker::wide_test {
namespace {

// Promise: products, sums and comparisons whose values are known by hand, carries and signs among them.
TEST(Wide, KnownValues) {
    const PairOfWords most = std::numeric_limits<std::int64_t>::max(), least = std::numeric_limits<std::int64_t>::min();
    EXPECT_EQ(least * least, PairOfWords(std::uint64_t{1} << 62, 0));                       // 2^126
    EXPECT_EQ(most * most, PairOfWords((std::uint64_t{1} << 62) - 1, 1));                   // (2^63 - 1)^2
    EXPECT_EQ(most * least, PairOfWords(~std::uint64_t{0} << 62, std::uint64_t{1} << 63));  // -2^126 + 2^63
    EXPECT_EQ(most + 1, PairOfWords(0, std::uint64_t{1} << 63));
    EXPECT_EQ(PairOfWords(0, ~std::uint64_t{0}) + 1, PairOfWords(1, 0));
    EXPECT_EQ(PairOfWords(1, 0) - 1, PairOfWords(0, ~std::uint64_t{0}));
    EXPECT_EQ(PairOfWords(0) - 1, PairOfWords(-1));
    EXPECT_EQ(PairOfWords(-3) * 5, PairOfWords(-15));
    EXPECT_EQ(PairOfWords(-3) * -5, PairOfWords(15));
    EXPECT_LT(least * most, least);
    EXPECT_LT(least, PairOfWords(-1));
    EXPECT_LT(PairOfWords(-1), PairOfWords(0));
    EXPECT_LT(PairOfWords(0, ~std::uint64_t{0}), PairOfWords(1, 0));
    EXPECT_GT(most * most, most);
}

// Promise: (a + b) (a - b) = a a - b b, whatever overflows; on 64-bit processors also every result of the compiler's
// own.
TEST(Wide, KeepsTheRules) {
    Random random(1);
    const auto any = [&random] {  // of every size
        const std::uint32_t high_shift = random.below(64);
        const std::uint64_t high = random.next() >> high_shift;
        const std::uint32_t low_shift = random.below(64);
        const PairOfWords value(high, random.next() >> low_shift);
        return random.below(2) == 0 ? value : PairOfWords(0) - value;
    };
    for (int i = 0; i < 20'000; ++i) {
        const PairOfWords a = any(), b = any();
        ASSERT_EQ((a + b) * (a - b), a * a - b * b);
        ASSERT_EQ(a<b, b> a);
#ifdef __SIZEOF_INT128__
        __extension__ using Unsigned = unsigned __int128;
        const auto native = [](PairOfWords x) { return Unsigned(x.high()) << 64U | x.low(); };
        const Unsigned x = native(a), y = native(b);
        ASSERT_TRUE(native(a + b) == x + y);
        ASSERT_TRUE(native(a - b) == x - y);
        ASSERT_TRUE(native(a * b) == x * y);
        ASSERT_EQ(a < b, Wide(x) < Wide(y));
        ASSERT_EQ(a == b, x == y);
#endif
    }
}

}  // namespace
}  // namespace stillmesh::mesh_checker::wide_test
