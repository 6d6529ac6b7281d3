#include "engine/pose/unsure_stretch.hpp"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <cstdint>
#include <utility>
#include <vector>

#include "tests/support/synthetic.hpp"

namespace stillmesh::unsure_stretch_test {
namespace {

constexpr std::int64_t kFrame_ns = 33'333'333;

class Stretch : public testing::Test {
protected:
    // A sure frame at `x` metres, `frame` frames behind the first.
    [[nodiscard]] bool sure(std::int64_t frame, double x, double stray_m = 0.015) {
        const UnsureStretch::Verdict verdict = stretch_.end(frame * kFrame_ns, Vector3(x, 1, -2), stray_m);
        since_ = verdict.since_ns == kNoTime ? -1 : verdict.since_ns / kFrame_ns;
        return verdict.has_strayed;
    }
    void unsure(std::int64_t frame, double x, double y = 0) { stretch_.add(frame * kFrame_ns, Vector3(x, 1 + y, -2)); }
    UnsureStretch stretch_;
    std::int64_t since_ = -1;  // frame, of the last stretch
};

// Promise: what goes straight on from one sure pose to the next has not strayed, however far it goes; what leaves the
// line has, aside or along it.
TEST_F(Stretch, WhatLeavesTheLineHasStrayed) {
    EXPECT_FALSE(sure(0, 0));
    for (int i = 1; i < 4; ++i) unsure(i, 0.1 * i);
    EXPECT_FALSE(sure(4, 0.4));
    for (const double aside : {0.0149, 0.0151}) {
        EXPECT_FALSE(sure(4, 0.4));
        for (int i = 5; i < 8; ++i) unsure(i, 0.1 * i, i == 6 ? aside : 0.0);
        EXPECT_EQ(sure(8, 0.8), aside > 0.015) << aside;
        EXPECT_EQ(since_, aside > 0.015 ? 4 : -1);
        for (int i = 9; i < 12; ++i) unsure(i, 0.1 * i + (i == 10 ? aside : 0.0));
        EXPECT_EQ(sure(12, 1.2), aside > 0.015) << aside;
        stretch_.reset();
    }
}

// Promise: one pose is enough; frames without one say nothing, and where there is one nobody knows since when.
TEST_F(Stretch, FramesWithoutAPoseSayNothing) {
    EXPECT_FALSE(sure(0, 0));
    unsure(1, 1);
    EXPECT_TRUE(sure(2, 0));
    EXPECT_EQ(since_, 0);
    unsure(3, 1);
    stretch_.add_without_pose();
    EXPECT_TRUE(sure(5, 0));
    EXPECT_EQ(since_, -1);  // the line says nothing of frames without a pose
    for (int i = 0; i < 30; ++i) stretch_.add_without_pose();
    EXPECT_FALSE(sure(36, 5));
    unsure(37, 6);
    EXPECT_TRUE(sure(38, 5));
    EXPECT_EQ(since_, 36);
}

// Promise: a stretch of more poses than are kept has strayed, since nobody knows; before the first sure pose and behind
// a reset there is no line to leave.
TEST_F(Stretch, ALongOneHasStrayed) {
    for (int i = 0; i < 10; ++i) unsure(i, i % 2);
    EXPECT_FALSE(sure(10, 0));
    for (const std::size_t poses : {UnsureStretch::kPosesMax, UnsureStretch::kPosesMax + 1}) {
        stretch_.reset();
        EXPECT_FALSE(sure(0, 0));
        const auto last = static_cast<std::int64_t>(poses);
        for (std::int64_t i = 1; i <= last; ++i) unsure(i, 0);
        EXPECT_EQ(sure(last + 1, 0), poses > UnsureStretch::kPosesMax);
        EXPECT_EQ(since_, -1);
    }
    for (int i = 0; i < 10; ++i) unsure(20 + i, 1);
    stretch_.reset();
    EXPECT_FALSE(sure(31, 0));
}

// Promise: over random paths at uneven times it says what looking at all poses says.
TEST_F(Stretch, AgreesWithBruteForce) {
    Random random(5);
    const auto point = [&](double size) -> Vector3 {
        return Vector3(random.normal(), random.normal(), random.normal()) * size;
    };
    int strayed = 0;
    for (int round = 0; round < 2000; ++round) {
        const double stray_m = 0.001 * (1 + random.below(60));
        std::int64_t now_ns = random.below(1000) * kFrame_ns;
        const std::int64_t begin_ns = now_ns;
        const Vector3 begin = point(3);
        const Vector3 velocity = point(0.5);
        static_cast<void>(stretch_.end(begin_ns, begin, 1));
        std::vector<std::pair<std::int64_t, Vector3>> poses;
        std::uint32_t frames = 0;
        for (std::uint32_t i = random.below(20); i > 0; --i, ++frames) {
            now_ns += 1 + random.below(100'000'000);
            if (random.below(5) == 0) {
                stretch_.add_without_pose();
                continue;
            }
            poses.emplace_back(now_ns,
                               begin + velocity * (1e-9 * static_cast<double>(now_ns - begin_ns)) + point(0.01));
            stretch_.add(now_ns, poses.back().second);
        }
        now_ns += 1 + random.below(100'000'000);
        const Vector3 end = begin + velocity * (1e-9 * static_cast<double>(now_ns - begin_ns)) + point(0.01);
        double worst = poses.size() > UnsureStretch::kPosesMax ? 1e9 : 0.0;
        for (const auto& [time_ns, position] : poses) {
            const double share = static_cast<double>(time_ns - begin_ns) / static_cast<double>(now_ns - begin_ns);
            worst = std::max(worst, (position - begin - (end - begin) * share).norm());
        }
        const bool expected = worst > stray_m;
        const bool is_close = std::abs(worst - stray_m) < 1e-6;  // kept in single precision
        const UnsureStretch::Verdict said = stretch_.end(now_ns, end, stray_m);
        if (!is_close) {
            EXPECT_EQ(said.has_strayed, expected) << "round " << round << ": " << worst << " of " << stray_m;
            const bool is_known = expected && poses.size() == frames && frames <= UnsureStretch::kPosesMax;
            EXPECT_EQ(said.since_ns, is_known ? begin_ns : kNoTime);
        }
        strayed += expected ? 1 : 0;
    }
    EXPECT_GT(strayed, 300);
    EXPECT_LT(strayed, 1700);
}

}  // namespace
}  // namespace stillmesh::unsure_stretch_test
