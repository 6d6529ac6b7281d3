#include "engine/features/hamming.hpp"

#include <gtest/gtest.h>

#include <bit>
#include <cstdint>

#include "engine/base/random.hpp"
#include "engine/frame/kernels.hpp"
#include "platform/linux/cpu_kernels.hpp"

namespace stillmesh::hamming_test {
namespace {

std::uint32_t counted(const Descriptor& a, const Descriptor& b) {
    std::uint32_t bits = 0;
    for (int i = 0; i < 256; ++i) bits += (a.words[i / 64] >> (i % 64) & 1U) != (b.words[i / 64] >> (i % 64) & 1U);
    return bits;
}

Descriptor random_descriptor(Random& random, std::uint32_t density) {
    Descriptor d;
    for (std::uint64_t& word : d.words) {
        word = random.next();
        for (std::uint32_t i = 0; i < density; ++i) word &= random.next();
    }
    return d;
}

// Promise: the distance is the number of different bits: 0, 256 and everything between, each bit alone.
TEST(Hamming, CountsBits) {
    const Descriptor zero;
    Descriptor ones;
    for (std::uint64_t& word : ones.words) word = ~std::uint64_t{0};
    EXPECT_EQ(hamming_distance(zero, zero), 0U);
    EXPECT_EQ(hamming_distance(zero, ones), 256U);
    EXPECT_EQ(hamming_distance(ones, ones), 0U);
    Descriptor growing;
    for (std::uint32_t i = 0; i < 256; ++i) {
        Descriptor one;
        one.words[i / 64] = std::uint64_t{1} << (i % 64);
        EXPECT_EQ(hamming_distance(zero, one), 1U) << i;
        EXPECT_EQ(hamming_distance(ones, one), 255U) << i;
        growing.words[i / 64] |= one.words[i / 64];
        EXPECT_EQ(hamming_distance(growing, zero), i + 1) << i;
    }
}

// Promise: random descriptors of every density, both ways round, and equal to every kernel of this processor.
TEST(Hamming, EqualsBruteForceAndTheKernels) {
    Random random(1);
    for (int round = 0; round < 100'000; ++round) {
        const Descriptor a = random_descriptor(random, static_cast<std::uint32_t>(round % 4));
        const Descriptor b = random_descriptor(random, static_cast<std::uint32_t>(round / 4 % 4));
        const std::uint32_t wanted = counted(a, b);
        ASSERT_EQ(hamming_distance(a, b), wanted);
        ASSERT_EQ(hamming_distance(b, a), wanted);
        ASSERT_EQ(plain_kernels().hamming(a.words, b.words), wanted);
        ASSERT_EQ(cpu_kernels().hamming(a.words, b.words), wanted);
    }
}

}  // namespace
}  // namespace stillmesh::hamming_test
