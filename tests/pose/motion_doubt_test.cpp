#include "engine/pose/motion_doubt.hpp"

#include <gtest/gtest.h>

#include <cstdint>

namespace stillmesh::motion_doubt_test {
namespace {

constexpr std::int64_t kSecond_ns = 1'000'000'000;
constexpr std::int64_t kBin_ns = MotionDoubt::kWindow_ns / (static_cast<std::int64_t>(MotionDoubt::kEntriesMax) - 1);

// Promise: what was added counts from then on for a second, and for a bin longer at most; translation and rotation are
// summed apart.
TEST(MotionDoubt, CountsForASecond) {
    for (const std::int64_t start_ns : {std::int64_t{0}, std::int64_t{5}, 7 * kSecond_ns + 123, kSecond_ns << 30U}) {
        MotionDoubt doubt;
        doubt.add(start_ns, {1.0, 16.0});
        doubt.add(start_ns + kSecond_ns / 2, {2.0, 32.0});
        EXPECT_EQ(doubt.over_window(start_ns + kSecond_ns / 2).translation_m2, 3.0);
        EXPECT_EQ(doubt.over_window(start_ns + kSecond_ns - kBin_ns).translation_m2, 3.0);
        EXPECT_EQ(doubt.over_window(start_ns + kSecond_ns - kBin_ns).rotation_rad2, 48.0);
        EXPECT_EQ(doubt.over_window(start_ns + kSecond_ns + 2 * kBin_ns).translation_m2, 2.0);
        EXPECT_EQ(doubt.over_window(start_ns + kSecond_ns + 2 * kBin_ns).rotation_rad2, 32.0);
        EXPECT_EQ(doubt.over_window(start_ns + 2 * kSecond_ns).translation_m2, 0.0);
    }
}

// Promise: at any frame rate the sum is that of the last second, give or take a bin: faster cameras than there are bins
// lose nothing, slow ones keep nothing too long.
TEST(MotionDoubt, FrameRatesMakeNoDifference) {
    for (const std::int64_t per_second : {std::int64_t{1}, std::int64_t{7}, std::int64_t{30}, std::int64_t{63},
                                          std::int64_t{64}, std::int64_t{200}, std::int64_t{1000}}) {
        MotionDoubt doubt;
        const std::int64_t gap_ns = kSecond_ns / per_second;
        for (std::int64_t i = 0; i < 5 * per_second; ++i) {
            const std::int64_t now_ns = i * gap_ns;
            doubt.add(now_ns, {1.0, 2.0});
            // Brute force: of the window for certain, and of the window and a bin at most.
            double least = 0, most = 0;
            for (std::int64_t k = 0; k <= i; ++k) {
                least += now_ns - k * gap_ns <= kSecond_ns - kBin_ns ? 1.0 : 0.0;
                most += now_ns - k * gap_ns <= kSecond_ns + 2 * kBin_ns ? 1.0 : 0.0;
            }
            const MotionDoubt::Variance sum = doubt.over_window(now_ns);
            ASSERT_GE(sum.translation_m2, least) << per_second << " Hz, frame " << i;
            ASSERT_LE(sum.translation_m2, most) << per_second << " Hz, frame " << i;
            ASSERT_EQ(sum.rotation_rad2, 2.0 * sum.translation_m2);
        }
    }
}

// Promise: after any gap nothing of before is left, not even where the bins come round to the same place.
TEST(MotionDoubt, ForgetsOverAGap) {
    constexpr auto kBins = static_cast<std::int64_t>(MotionDoubt::kEntriesMax);
    for (const std::int64_t bins : {kBins, kBins + 1, 2 * kBins, 5 * kBins - 1, 1'000'003 * kBins}) {
        MotionDoubt doubt;
        for (std::int64_t i = 0; i < kBins; ++i) doubt.add(i * kBin_ns, {100.0, 100.0});
        const std::int64_t later_ns = (kBins - 1 + bins) * kBin_ns;
        EXPECT_EQ(doubt.over_window(later_ns).translation_m2, 0.0) << bins;
        doubt.add(later_ns, {1.0, 2.0});
        EXPECT_EQ(doubt.over_window(later_ns).translation_m2, 1.0) << bins;
        EXPECT_EQ(doubt.over_window(later_ns).rotation_rad2, 2.0) << bins;
    }
}

// Promise: a reset forgets everything, and time may begin anew, earlier than before.
TEST(MotionDoubt, ResetForgets) {
    MotionDoubt doubt;
    doubt.add(10 * kSecond_ns, {1.0, 1.0});
    doubt.reset();
    EXPECT_EQ(doubt.over_window(10 * kSecond_ns).translation_m2, 0.0);
    doubt.add(kSecond_ns, {4.0, 8.0});
    EXPECT_EQ(doubt.over_window(kSecond_ns).translation_m2, 4.0);
    EXPECT_EQ(doubt.over_window(kSecond_ns).rotation_rad2, 8.0);
}

}  // namespace
}  // namespace stillmesh::motion_doubt_test
