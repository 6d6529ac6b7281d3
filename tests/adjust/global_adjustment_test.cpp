#include "engine/adjust/global_adjustment.hpp"

#include <gtest/gtest.h>

#include <bit>
#include <cmath>
#include <cstdint>
#include <vector>

#include "tests/adjust/global_window.hpp"
#include "tests/support/check_message.hpp"
#include "tests/support/memory.hpp"

namespace stillmesh::global_adjustment_test {
namespace {

using Adjustment = test::InMemory<GlobalAdjustment>;

// Promise: without noise everything is where it truly is, from centimetres away; the fixed keyframe stays to the bit.
TEST(GlobalAdjustment, FindsTheTruth) {
    test::WindowOptions options;
    options.has_noise = false;
    options.free = 20;
    options.fixed = 1;
    options.points = 400;
    options.observations = 2400;
    const test::Window window = test::make_window(options);
    Adjustment adjustment(test::global_sizes(window));
    EXPECT_EQ(adjustment.used_bytes(), adjustment.planned_bytes());
    ASSERT_TRUE(test::load(window, *adjustment));
    adjustment->start(test::exact_global_options());
    WorkBudget budget(UINT32_MAX);
    ASSERT_EQ(adjustment->step(budget), Progress::kDone);
    EXPECT_EQ(adjustment->summary().observations, window.observations.size());
    for (std::uint32_t i = 0; i < adjustment->keyframes(); ++i) {
        const Vector6 off = se3_log(window.true_poses[i].inverse() * adjustment->pose(i));
        EXPECT_LT(std::sqrt(off.squaredNorm()), 1e-5) << i;
    }
    EXPECT_EQ((adjustment->pose(0).translation - window.poses[0].translation).squaredNorm(), 0.0);
}

// Promise: any slicing gives the same bits, and no slice overdraws by more than the stated ceiling.
TEST(GlobalAdjustment, AnySlicingGivesTheSameBits) {
    test::WindowOptions options;
    options.free = 12;
    options.fixed = 1;
    options.points = 200;
    options.observations = 1200;
    options.outlier_share = 0.05;
    options.outlier_scale = 10;
    const test::Window window = test::make_window(options);
    Adjustment adjustment(test::global_sizes(window));
    std::vector<std::uint64_t> wanted;
    for (const std::uint32_t slice : {UINT32_MAX, 1U, 37U, 5000U}) {
        ASSERT_TRUE(test::load(window, *adjustment));
        adjustment->start(GlobalOptions{});
        for (;;) {
            WorkBudget budget(slice);
            const Progress progress = adjustment->step(budget);
            EXPECT_LT(budget.units_spent(), std::uint64_t{slice} + adjustment->piece_units_max());
            if (progress == Progress::kDone) break;
            ASSERT_EQ(progress, Progress::kWorking);
        }
        std::vector<std::uint64_t> bits;
        for (std::uint32_t i = 0; i < adjustment->keyframes(); ++i) {
            for (int k = 0; k < 3; ++k)
                bits.push_back(std::bit_cast<std::uint64_t>(adjustment->pose(i).translation(k)));
            for (int k = 0; k < 9; ++k) {
                bits.push_back(std::bit_cast<std::uint64_t>(adjustment->pose(i).rotation(k / 3, k % 3)));
            }
        }
        for (std::uint32_t i = 0; i < adjustment->points(); ++i) {
            for (int k = 0; k < 3; ++k) bits.push_back(std::bit_cast<std::uint64_t>(adjustment->point(i)(k)));
        }
        bits.push_back(adjustment->summary().units);
        if (wanted.empty()) wanted = bits;
        ASSERT_EQ(bits, wanted) << slice;
        EXPECT_LT(adjustment->summary().final_cost, 0.5 * adjustment->summary().initial_cost);
    }
}

// Promise: full says kFull, garbage is refused, an empty problem is done at once.
TEST(GlobalAdjustment, RefusesWhatItCannotUse) {
    Adjustment adjustment(GlobalSizes{1, 1, 1});
    adjustment->start(GlobalOptions{});
    EXPECT_TRUE(adjustment->is_done());
    adjustment->begin();
    ASSERT_TRUE(adjustment->add_keyframe(SE3{}, false).is_ok());
    EXPECT_EQ(adjustment->add_keyframe(SE3{}, false).status(), Status::kFull);
    ASSERT_TRUE(adjustment->add_point(Vector3(0, 0, 2)).is_ok());
    EXPECT_EQ(adjustment->add_point(Vector3(0, 0, 2)).status(), Status::kFull);
    EXPECT_EQ(adjustment->reserve(0), Status::kOk);
    EXPECT_EQ(adjustment->reserve(0), Status::kFull);
    adjustment->fill();
    EXPECT_EQ(adjustment->add_observation({0, 0, std::nan(""), 0, 1e-6, 2, 1e-4}), Status::kInvalid);
    EXPECT_EQ(adjustment->add_observation({0, 0, 0, 0, 0, 2, 1e-4}), Status::kInvalid);
    EXPECT_EQ(adjustment->add_observation({0, 0, 0, 0, 1e-6, 2, 1e-4}), Status::kOk);
    EXPECT_EQ(adjustment->add_observation({0, 0, 0, 0, 1e-6, 2, 1e-4}), Status::kFull);
    adjustment->start(GlobalOptions{});
    WorkBudget budget(UINT32_MAX);
    EXPECT_EQ(adjustment->step(budget), Progress::kDone);
    EXPECT_EQ(adjustment->point(0).z(), 2.0);
}

}  // namespace
}  // namespace stillmesh::global_adjustment_test
