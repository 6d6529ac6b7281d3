#include "hal/live/frame_pairer.hpp"

#include <gtest/gtest.h>

#include <algorithm>
#include <cstdlib>
#include <random>
#include <vector>

namespace stillmesh::frame_pairer_test {
namespace {

constexpr std::int64_t kPeriod_us = 33'333;

// Promise: against every possible pairing: each image gets the nearest partner within half a period, whatever is lost,
// with any lag and jitter of up to a tenth of a period.
TEST(FramePairer, FindsTheNearestPartner) {
    std::mt19937 random(7);
    for (int trial = 0; trial < 300; ++trial) {
        const std::int64_t lag_us = static_cast<std::int64_t>(random() % 60'000) - 30'000;
        struct Image {
            std::int64_t time_us;
            bool is_colour;
        };
        std::vector<Image> images;
        for (std::int64_t i = 0; i < 60; ++i) {
            const auto jitter = [&random] { return static_cast<std::int64_t>(random() % 3000) - 1500; };
            if (random() % 5 != 0) images.push_back({1'000'000 + i * kPeriod_us + jitter(), true});
            if (random() % 5 != 0) images.push_back({1'000'000 + i * kPeriod_us + lag_us + jitter(), false});
        }
        std::stable_sort(images.begin(), images.end(),
                         [](const Image& a, const Image& b) { return a.time_us < b.time_us; });
        FramePairer<int> pairer(kPeriod_us);
        std::uint64_t pairs = 0;
        for (const Image& image : images) {
            const auto pair =
                image.is_colour ? pairer.add_colour(0, image.time_us) : pairer.add_depth(0, image.time_us);
            if (!pair) continue;
            ++pairs;
            const std::int64_t apart = std::abs(pair->colour_us - pair->depth_us);
            ASSERT_LE(apart, kPeriod_us / 2);
            for (const Image& other : images) {
                if (other.is_colour) continue;
                const std::int64_t distance = std::abs(other.time_us - pair->colour_us);
                // With jitter the next one may be nearer, by no more than the jitter.
                ASSERT_GE(distance, apart - 6000);
            }
        }
        // Every colour image with a partner clearly within reach was paired.
        std::uint64_t possible = 0;
        for (const Image& image : images) {
            possible += image.is_colour && std::any_of(images.begin(), images.end(), [&image](const Image& other) {
                            return !other.is_colour && std::abs(other.time_us - image.time_us) < kPeriod_us / 2 - 3000;
                        });
        }
        ASSERT_GE(pairs + 1, possible) << lag_us;
        ASSERT_EQ(pairer.counts().pairs, pairs);
        ASSERT_LE(2 * pairs + pairer.counts().colour_alone + pairer.counts().depth_alone, images.size());
        ASSERT_GE(2 * pairs + pairer.counts().colour_alone + pairer.counts().depth_alone + 1, images.size());
    }
}

// Promise: one stream alone makes no pair and is counted; when the other comes back the very next images pair.
TEST(FramePairer, OneStreamAlone) {
    FramePairer<int> pairer(kPeriod_us);
    for (int i = 0; i < 100; ++i) EXPECT_FALSE(pairer.add_colour(i, i * kPeriod_us).has_value());
    EXPECT_EQ(pairer.counts().colour_alone, 99U);
    EXPECT_FALSE(pairer.add_colour(100, 100 * kPeriod_us).has_value());
    const auto pair = pairer.add_depth(7, 100 * kPeriod_us + 5000);
    ASSERT_TRUE(pair.has_value());
    EXPECT_EQ(pair->colour, 100);
    EXPECT_EQ(pair->depth, 7);
    EXPECT_EQ(pairer.counts().lag_sum_us, 5000);
}

// Promise: streams whose clock restarts, one after the other, pair again once both have.
TEST(FramePairer, ClocksThatRestart) {
    FramePairer<int> pairer(kPeriod_us);
    EXPECT_FALSE(pairer.add_colour(0, 9'000'000).has_value());
    EXPECT_TRUE(pairer.add_depth(0, 9'000'000).has_value());
    EXPECT_FALSE(pairer.add_depth(1, 9'033'333).has_value());
    EXPECT_FALSE(pairer.add_colour(1, 10).has_value());
    EXPECT_FALSE(pairer.add_colour(2, kPeriod_us + 10).has_value());
    EXPECT_FALSE(pairer.add_depth(2, kPeriod_us + 9 + kPeriod_us).has_value());
    EXPECT_TRUE(pairer.add_colour(3, 2 * kPeriod_us + 10).has_value());
}

}  // namespace
}  // namespace stillmesh::frame_pairer_test
