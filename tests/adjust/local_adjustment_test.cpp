#include "engine/adjust/local_adjustment.hpp"

#include <gtest/gtest.h>

#include <algorithm>
#include <bit>
#include <cmath>
#include <string>
#include <vector>

#include "engine/base/hash.hpp"
#include "tests/adjust/window.hpp"
#include "tests/support/check_message.hpp"
#include "tests/support/memory.hpp"

namespace stillmesh::local_adjustment_test {
namespace {

using test::make_window;
using test::Window;
using test::WindowOptions;
using Adjustment = test::InMemory<LocalAdjustment>;

constexpr double kNoThreshold = 1e11;

// Iterates until nothing moves any more.
AdjustmentOptions exact_options() {
    AdjustmentOptions options;
    options.iterations_max[0] = 60;
    options.iterations_max[1] = 0;
    options.chi2_max_pixel = options.chi2_max_depth = kNoThreshold;
    options.cost_change_min = 1e-14;
    return options;
}

// Everything a caller can read, byte by byte.
std::vector<std::uint64_t> results_of(const LocalAdjustment& adjustment) {
    std::vector<std::uint64_t> out;
    const auto add = [&out](double number) { out.push_back(std::bit_cast<std::uint64_t>(number)); };
    for (std::uint32_t i = 0; i < adjustment.keyframes(); ++i) {
        for (int r = 0; r < 3; ++r) {
            for (int c = 0; c < 3; ++c) add(adjustment.pose(i).rotation(r, c));
            add(adjustment.pose(i).translation(r));
        }
    }
    for (std::uint32_t i = 0; i < adjustment.points(); ++i) {
        for (int k = 0; k < 3; ++k) add(adjustment.point(i)(k));
        out.push_back(adjustment.is_point_used(i) ? 1 : 0);
    }
    for (std::uint32_t i = 0; i < adjustment.observations(); ++i) {
        add(adjustment.chi2(i));
        out.push_back(adjustment.is_outlier(i) ? 1 : 0);
    }
    const AdjustmentSummary& s = adjustment.summary();
    for (const std::uint32_t n : {static_cast<std::uint32_t>(s.outcome), s.iterations, s.steps_accepted,
                                  s.observations_used, s.residuals_used, s.outliers, s.points_used, s.keyframes_used}) {
        out.push_back(n);
    }
    for (const double cost : {s.initial_cost, s.first_round_cost, s.final_cost}) add(cost);
    out.push_back(s.units);
    return out;
}

bool is_input(const LocalAdjustment& adjustment, const Window& window) {
    for (std::uint32_t i = 0; i < adjustment.keyframes(); ++i) {
        if (adjustment.pose(i).rotation != window.poses[i].rotation) return false;
        if (adjustment.pose(i).translation != window.poses[i].translation) return false;
    }
    for (std::uint32_t i = 0; i < adjustment.points(); ++i) {
        if (adjustment.point(i) != window.points[i]) return false;
    }
    return true;
}

struct Error {
    double m = 0, rad = 0, point_m = 0;  // the largest
};
Error error_of(const LocalAdjustment& adjustment, const Window& window) {
    Error error;
    for (std::uint32_t i = 0; i < adjustment.keyframes(); ++i) {
        const Vector6 off = se3_log(window.true_poses[i].inverse() * adjustment.pose(i));
        error.m = std::max(error.m, std::sqrt(off.head<3>().squaredNorm()));
        error.rad = std::max(error.rad, std::sqrt(off.tail<3>().squaredNorm()));
    }
    for (std::uint32_t i = 0; i < adjustment.points(); ++i) {
        const Vector3 off = adjustment.point(i) - window.true_points[i];
        error.point_m = std::max(error.point_m, std::sqrt(off.squaredNorm()));
    }
    return error;
}

void expect_finite(const LocalAdjustment& adjustment) {
    for (std::uint32_t i = 0; i < adjustment.keyframes(); ++i) {
        for (int r = 0; r < 3; ++r) {
            for (int c = 0; c < 3; ++c) ASSERT_TRUE(std::isfinite(adjustment.pose(i).rotation(r, c)));
            ASSERT_TRUE(std::isfinite(adjustment.pose(i).translation(r)));
        }
    }
    for (std::uint32_t i = 0; i < adjustment.points(); ++i) {
        for (int k = 0; k < 3; ++k) ASSERT_TRUE(std::isfinite(adjustment.point(i)(k)));
    }
    for (std::uint32_t i = 0; i < adjustment.observations(); ++i) ASSERT_TRUE(std::isfinite(adjustment.chi2(i)));
    const AdjustmentSummary& s = adjustment.summary();
    ASSERT_TRUE(std::isfinite(s.initial_cost) && std::isfinite(s.first_round_cost) && std::isfinite(s.final_cost));
}

// Promise: plan and create use the same bytes.
TEST(LocalAdjustment, UsesWhatItPlans) {
    Adjustment adjustment(AdjustmentSizes{10, 10, 1500, 8000});
    EXPECT_EQ(adjustment.used_bytes(), adjustment.planned_bytes());
}

// Promise: from exact measurements a disturbed window returns to the truth, with depth, with some, and without.
TEST(LocalAdjustment, ExactMeasurementsGiveTheTruth) {
    for (const double depth_share : {1.0, 0.3, 0.0}) {
        WindowOptions options;
        options.has_noise = false;
        options.depth_share = depth_share;
        options.seed = 11;
        const Window window = make_window(options);
        Adjustment adjustment(window.sizes());
        ASSERT_TRUE(window.load(*adjustment));
        adjustment->start(exact_options());
        ASSERT_EQ(test::run_to_end(*adjustment), Progress::kDone);
        EXPECT_EQ(adjustment->summary().outcome, AdjustmentOutcome::kConverged);
        const Error error = error_of(*adjustment, window);
        EXPECT_LT(error.m, 1e-9) << depth_share;
        EXPECT_LT(error.rad, 1e-9) << depth_share;
        for (std::uint32_t i = 0; i < adjustment->points(); ++i) {
            if (!adjustment->is_point_used(i)) continue;
            const Vector3 off = adjustment->point(i) - window.true_points[i];
            EXPECT_LT(std::sqrt(off.squaredNorm()), 1e-8) << depth_share;
        }
    }
}

// Promise: with noise as assumed the cost at the minimum is about the degrees of freedom, and most poses get better.
TEST(LocalAdjustment, NoiseCostsItsDegreesOfFreedom) {
    WindowOptions options;
    options.points = 400;
    options.observations = 2000;
    const Window window = make_window(options);
    Adjustment adjustment(window.sizes());
    ASSERT_TRUE(window.load(*adjustment));
    adjustment->start(exact_options());
    ASSERT_EQ(test::run_to_end(*adjustment), Progress::kDone);
    const AdjustmentSummary& s = adjustment->summary();
    const double freedom = static_cast<double>(s.residuals_used) - 6.0 * s.keyframes_used - 3.0 * s.points_used;
    EXPECT_LT(s.final_cost, s.initial_cost * 0.05);
    EXPECT_NEAR(s.final_cost / freedom, 1.0, 5.0 * std::sqrt(2.0 / freedom));
    EXPECT_LT(error_of(*adjustment, window).m, 0.003);
}

// Promise: with every fifth observation a gross mistake the poses are nearly as good as without them, the mistakes are
// called outliers, and hardly anything else is.
TEST(LocalAdjustment, GrossOutliersAreFoundAndIgnored) {
    WindowOptions options;
    options.points = 400;
    options.observations = 2400;
    options.outlier_share = 0.2;
    options.seed = 21;
    const Window window = make_window(options);
    Adjustment adjustment(window.sizes());
    ASSERT_TRUE(window.load(*adjustment));
    AdjustmentOptions two_rounds;
    two_rounds.iterations_max[0] = 15;
    two_rounds.iterations_max[1] = 10;
    adjustment->start(two_rounds);
    ASSERT_EQ(test::run_to_end(*adjustment), Progress::kDone);
    EXPECT_LT(error_of(*adjustment, window).m, 0.004);
    EXPECT_LT(error_of(*adjustment, window).rad, 0.002);
    std::uint32_t wrong = 0, missed = 0, good_called_outlier = 0;
    for (std::uint32_t i = 0; i < adjustment->observations(); ++i) {
        wrong += window.is_outlier[i] ? 1U : 0U;
        missed += window.is_outlier[i] && !adjustment->is_outlier(i) ? 1U : 0U;
        good_called_outlier += !window.is_outlier[i] && adjustment->is_outlier(i) ? 1U : 0U;
    }
    EXPECT_LT(missed, wrong / 20);
    EXPECT_LT(good_called_outlier, (adjustment->observations() - wrong) / 5);
    EXPECT_EQ(adjustment->summary().outliers, wrong - missed + good_called_outlier);
    // The second round ran without them.
    const AdjustmentSummary& s = adjustment->summary();
    EXPECT_LT(s.observations_used, adjustment->observations() - wrong * 9 / 10);
    EXPECT_LT(s.final_cost, 1.2 * s.residuals_used);
}

// Promise: what has too little left after the outliers are dropped stays where the first round put it, however many
// steps the second takes.
TEST(LocalAdjustment, WhatLeavesAfterTheFirstRoundStaysThere) {
    std::uint32_t points_left = 0, keyframes_left = 0;
    for (std::uint64_t seed = 1; seed <= 6; ++seed) {
        WindowOptions options;
        options.seed = seed;
        options.outlier_share = 0.1;
        Window window = make_window(options);
        constexpr std::uint32_t kLost = 4;
        for (AdjustmentObservation& o : window.observations) {
            if (o.keyframe == kLost) o.x = o.point % 2 == 0 ? 0.5 : -0.5;
        }
        for (const std::uint32_t second : {1U, 2U, 3U, 4U}) {
            AdjustmentOptions one_round;
            one_round.iterations_max[1] = 0;
            one_round.cost_change_min = 1e-9;
            AdjustmentOptions two_rounds = one_round;
            two_rounds.iterations_max[1] = second;
            Adjustment one(window.sizes());
            Adjustment two(window.sizes());
            ASSERT_TRUE(window.load(*one) && window.load(*two));
            one->start(one_round);
            two->start(two_rounds);
            ASSERT_EQ(test::run_to_end(*one), Progress::kDone);
            ASSERT_EQ(test::run_to_end(*two), Progress::kDone);
            for (std::uint32_t i = 0; i < one->points(); ++i) {
                if (!one->is_point_used(i) || two->is_point_used(i)) continue;
                ++points_left;
                EXPECT_EQ(two->point(i), one->point(i));
            }
            if (two->summary().keyframes_used < one->summary().keyframes_used) {
                ++keyframes_left;
                EXPECT_NE(two->pose(kLost).translation, window.poses[kLost].translation);
                EXPECT_EQ(two->pose(kLost).translation, one->pose(kLost).translation);
                EXPECT_EQ(two->pose(kLost).rotation, one->pose(kLost).rotation);
            }
        }
    }
    EXPECT_GT(points_left, 10U);
    EXPECT_GT(keyframes_left, 4U);
}

// Promise: however a job is cut into slices, every result has the same bits, and no slice overdraws by a whole piece.
TEST(LocalAdjustment, AnySlicingGivesTheSameBits) {
    Random random(77);
    for (std::uint64_t seed = 1; seed <= 6; ++seed) {
        WindowOptions options;
        options.seed = seed;
        options.depth_share = 0.2 * static_cast<double>(seed - 1);
        options.outlier_share = seed % 2 == 0 ? 0.1 : 0.0;
        options.free = seed == 3 ? 24 : 5;
        options.fixed = seed == 4 ? 0 : 3;  // none: the first one is
        const Window window = make_window(options);
        Adjustment whole(window.sizes());
        ASSERT_TRUE(window.load(*whole));
        whole->start(AdjustmentOptions{});
        ASSERT_EQ(test::run_to_end(*whole), Progress::kDone);
        const std::vector<std::uint64_t> expected = results_of(*whole);
        for (const std::uint32_t grant : {1U, 7U, 100U, 0U}) {
            Adjustment sliced(window.sizes());
            ASSERT_TRUE(window.load(*sliced));
            sliced->start(AdjustmentOptions{});
            Progress progress = Progress::kWorking;
            std::uint64_t spent = 0;
            while (progress == Progress::kWorking) {
                const std::uint32_t units = grant > 0 ? grant : 1 + random.below(1000);
                WorkBudget budget(units);
                progress = sliced->step(budget);
                EXPECT_LT(budget.units_spent(), units + LocalAdjustment::kPieceUnitsMax);
                EXPECT_GT(budget.units_spent(), 0U);
                spent += budget.units_spent();
            }
            ASSERT_EQ(progress, Progress::kDone);
            EXPECT_EQ(spent, sliced->summary().units);
            EXPECT_EQ(results_of(*sliced), expected) << "seed " << seed << " grant " << grant;
            WorkBudget more(10);
            EXPECT_EQ(sliced->step(more), Progress::kIdle);
            EXPECT_EQ(more.units_spent(), 0U);
        }
    }
}

// Promise: a second job in the same memory has the bits of a first one, whatever ran there before, even half of it.
TEST(LocalAdjustment, NothingIsLeftOfTheJobBefore) {
    WindowOptions options;
    options.outlier_share = 0.1;
    const Window window = make_window(options);
    options.seed = 2;
    options.points = 100;
    const Window other = make_window(options);
    Adjustment fresh(window.sizes());
    ASSERT_TRUE(window.load(*fresh));
    fresh->start(AdjustmentOptions{});
    ASSERT_EQ(test::run_to_end(*fresh), Progress::kDone);
    const std::vector<std::uint64_t> expected = results_of(*fresh);
    for (const std::uint32_t units : {1U, 300U, 3000U, 30000U}) {
        AdjustmentSizes sizes = window.sizes();
        sizes.observations_max += other.sizes().observations_max;
        Adjustment used(sizes);
        ASSERT_TRUE(other.load(*used));
        used->start(AdjustmentOptions{});
        WorkBudget budget(units);
        static_cast<void>(used->step(budget));
        used->begin();
        EXPECT_FALSE(used->is_running());
        EXPECT_FALSE(used->is_done());
        ASSERT_TRUE(window.load(*used));
        used->start(AdjustmentOptions{});
        ASSERT_EQ(test::run_to_end(*used), Progress::kDone);
        EXPECT_EQ(results_of(*used), expected);
    }
}

// Promise: results before the job is done are our bug, and so is adding to a running job.
TEST(LocalAdjustmentDeathTest, ResultsAreReadWhenDone) {
    const Window window = make_window(WindowOptions{});
    Adjustment adjustment(window.sizes());
    ASSERT_TRUE(window.load(*adjustment));
    EXPECT_DEATH(static_cast<void>(adjustment->pose(0)), "is_done");
    adjustment->start(AdjustmentOptions{});
    WorkBudget budget(100);
    ASSERT_EQ(adjustment->step(budget), Progress::kWorking);
    EXPECT_TRUE(adjustment->is_running());
    EXPECT_DEATH(static_cast<void>(adjustment->point(0)), "is_done");
    EXPECT_DEATH(static_cast<void>(adjustment->summary()), "is_done");
    EXPECT_DEATH(static_cast<void>(adjustment->add_point(Vector3::Zero())), "kCollecting");
}

// Promise: fixed keyframes do not move by a bit; without any, the first one holds the world.
TEST(LocalAdjustment, FixedKeyframesDoNotMove) {
    for (const std::uint32_t fixed : {0U, 1U, 3U}) {
        WindowOptions options;
        options.fixed = fixed;
        options.seed = 5;
        const Window window = make_window(options);
        Adjustment adjustment(window.sizes());
        ASSERT_TRUE(window.load(*adjustment));
        adjustment->start(AdjustmentOptions{});
        ASSERT_EQ(test::run_to_end(*adjustment), Progress::kDone);
        EXPECT_GT(adjustment->summary().steps_accepted, 0U);
        for (std::uint32_t i = 0; i < adjustment->keyframes(); ++i) {
            const bool is_same = adjustment->pose(i).rotation == window.poses[i].rotation &&
                                 adjustment->pose(i).translation == window.poses[i].translation;
            EXPECT_EQ(is_same, i < std::max(fixed, 1U)) << i;
        }
    }
}

// Promise: each container takes exactly its limit, then says kFull and changes nothing.
TEST(LocalAdjustment, FullContainersSayFull) {
    const Window window = make_window(WindowOptions{});
    for (std::uint32_t n = 1; n <= 5; ++n) {
        Adjustment adjustment(AdjustmentSizes{n, n, n, n});
        for (std::uint32_t i = 0; i < n; ++i) {
            ASSERT_EQ(adjustment->add_keyframe(window.poses[0], true).value(), 2 * i);
            ASSERT_EQ(adjustment->add_keyframe(window.poses[2], false).value(), 2 * i + 1);
            ASSERT_EQ(adjustment->add_point(window.points[i]).value(), i);
        }
        for (std::uint32_t i = 0; i < n; ++i) {
            AdjustmentObservation o = window.observations[i];
            o.keyframe = i;
            o.point = i;
            ASSERT_EQ(adjustment->add_observation(o), Status::kOk);
        }
        EXPECT_EQ(adjustment->add_keyframe(window.poses[0], true).status(), Status::kFull);
        EXPECT_EQ(adjustment->add_keyframe(window.poses[0], false).status(), Status::kFull);
        EXPECT_EQ(adjustment->add_point(window.points[0]).status(), Status::kFull);
        AdjustmentObservation one_more = window.observations[0];
        one_more.keyframe = one_more.point = 0;
        EXPECT_EQ(adjustment->add_observation(one_more), Status::kFull);
        EXPECT_EQ(adjustment->keyframes(), 2 * n);
        EXPECT_EQ(adjustment->points(), n);
        EXPECT_EQ(adjustment->observations(), n);
        adjustment->start(AdjustmentOptions{});
        EXPECT_EQ(test::run_to_end(*adjustment), Progress::kDone);
        expect_finite(*adjustment);
    }
    // With sizes a few too small the rest is refused, and what went in is solved.
    for (std::uint32_t n = 1; n < 40; n += 3) {
        AdjustmentSizes sizes = window.sizes();
        sizes.observations_max -= n;
        Adjustment adjustment(sizes);
        EXPECT_FALSE(window.load(*adjustment));
        EXPECT_EQ(adjustment->observations(), sizes.observations_max);
        adjustment->start(AdjustmentOptions{});
        EXPECT_EQ(test::run_to_end(*adjustment), Progress::kDone);
        EXPECT_LT(adjustment->summary().final_cost, adjustment->summary().initial_cost);
    }
}

// Promise: what is not a number, not a rotation or not a variance is refused at the door.
TEST(LocalAdjustment, NonsenseIsInvalid) {
    Adjustment adjustment(AdjustmentSizes{2, 2, 4, 8});
    SE3 pose;
    pose.translation.y() = std::nan("");
    EXPECT_EQ(adjustment->add_keyframe(pose, false).status(), Status::kInvalid);
    pose = SE3{};
    pose.rotation(1, 1) = -1.0;  // a reflection
    EXPECT_EQ(adjustment->add_keyframe(pose, false).status(), Status::kInvalid);
    pose.rotation.setZero();
    EXPECT_EQ(adjustment->add_keyframe(pose, false).status(), Status::kInvalid);
    EXPECT_EQ(adjustment->add_point(Vector3(0, HUGE_VAL, 0)).status(), Status::kInvalid);
    ASSERT_TRUE(adjustment->add_keyframe(SE3{}, false).is_ok());
    ASSERT_TRUE(adjustment->add_point(Vector3(0, 0, 1)).is_ok());
    const AdjustmentObservation good{0, 0, 0.0, 0.0, 1e-6, 1.0, 1e-4};
    const auto refused = [&](auto change) {
        AdjustmentObservation o = good;
        change(o);
        return adjustment->add_observation(o) == Status::kInvalid;
    };
    for (const double bad : {std::nan(""), HUGE_VAL, -HUGE_VAL}) {
        EXPECT_TRUE(refused([&](AdjustmentObservation& o) { o.x = bad; }));
        EXPECT_TRUE(refused([&](AdjustmentObservation& o) { o.y = bad; }));
        EXPECT_TRUE(refused([&](AdjustmentObservation& o) { o.z_m = bad; }));
        EXPECT_TRUE(refused([&](AdjustmentObservation& o) { o.var_z = bad; }));
        EXPECT_TRUE(refused([&](AdjustmentObservation& o) { o.var_pixel = bad; }));
    }
    EXPECT_TRUE(refused([](AdjustmentObservation& o) { o.var_pixel = 0; }));
    EXPECT_TRUE(refused([](AdjustmentObservation& o) { o.var_pixel = -1; }));
    EXPECT_TRUE(refused([](AdjustmentObservation& o) { o.var_z = -1; }));
    EXPECT_TRUE(refused([](AdjustmentObservation& o) { o.var_pixel = 5e-324; }));
    EXPECT_EQ(adjustment->observations(), 0U);
    EXPECT_EQ(adjustment->add_observation(good), Status::kOk);
}

// Promise: without anything to solve the job ends at once, unchanged, and says so.
TEST(LocalAdjustment, NothingToSolve) {
    Adjustment empty(AdjustmentSizes{0, 0, 0, 0});
    empty->start(AdjustmentOptions{});
    EXPECT_EQ(test::run_to_end(*empty), Progress::kDone);
    EXPECT_EQ(empty->summary().outcome, AdjustmentOutcome::kUnchanged);

    Window window = make_window(WindowOptions{});
    const std::vector<AdjustmentObservation> all = window.observations;
    window.observations.clear();
    for (const std::size_t kept : {std::size_t{0}, std::size_t{1}}) {
        window.observations.assign(all.begin(), all.begin() + static_cast<std::ptrdiff_t>(kept));
        for (AdjustmentObservation& o : window.observations) o.var_z = 0;  // one ray places no point
        Adjustment adjustment(window.sizes());
        ASSERT_TRUE(window.load(*adjustment));
        adjustment->start(AdjustmentOptions{});
        EXPECT_EQ(test::run_to_end(*adjustment), Progress::kDone);
        EXPECT_EQ(adjustment->summary().outcome, AdjustmentOutcome::kUnchanged);
        EXPECT_EQ(adjustment->summary().points_used, 0U);
        EXPECT_TRUE(is_input(*adjustment, window));
    }
}

// Promise: a point seen once without depth stays as it is and has no say; so does a keyframe with two observations.
TEST(LocalAdjustment, WhatIsTooLittleStaysAsItIs) {
    WindowOptions options;
    Window window = make_window(options);
    const auto lonely = static_cast<std::uint32_t>(window.points.size());
    window.points.emplace_back(0.1, 0.1, 2.0);
    window.true_points.push_back(window.points.back());
    window.observations.push_back({3, lonely, 0.3, 0.2, 1e-6, 0.0, 0.0});
    const auto idle = static_cast<std::uint32_t>(window.poses.size());
    window.poses.push_back(window.poses[4]);
    window.true_poses.push_back(window.true_poses[4]);
    window.is_fixed.push_back(false);
    for (std::uint32_t i = 0; i < 2; ++i) {
        AdjustmentObservation o = window.observations[10 * i];
        o.keyframe = idle;
        window.observations.push_back(o);
    }
    Adjustment adjustment(window.sizes());
    ASSERT_TRUE(window.load(*adjustment));
    adjustment->start(AdjustmentOptions{});
    ASSERT_EQ(test::run_to_end(*adjustment), Progress::kDone);
    EXPECT_FALSE(adjustment->is_point_used(lonely));
    EXPECT_EQ(adjustment->point(lonely), window.points[lonely]);
    EXPECT_EQ(adjustment->pose(idle).translation, window.poses[idle].translation);
    EXPECT_EQ(adjustment->pose(idle).rotation, window.poses[idle].rotation);
    EXPECT_LT(adjustment->summary().final_cost, adjustment->summary().initial_cost);
}

// Promise: points behind a camera cost a constant, are outliers, and leave the rest alone.
TEST(LocalAdjustment, PointsBehindTheCameraAreOutliers) {
    WindowOptions options;
    Window window = make_window(options);
    std::vector<std::uint32_t> behind;
    for (std::uint32_t i = 0; i < 10; ++i) {
        const auto point = static_cast<std::uint32_t>(window.points.size());
        window.points.emplace_back(0.1 * i, 0.0, -3.0);
        window.true_points.push_back(window.points.back());
        for (std::uint32_t k = 0; k < 4; ++k) {
            behind.push_back(static_cast<std::uint32_t>(window.observations.size()));
            window.observations.push_back({k, point, 0.1, 0.1, 4e-6, 2.0, 1e-4});
        }
    }
    Adjustment adjustment(window.sizes());
    ASSERT_TRUE(window.load(*adjustment));
    adjustment->start(AdjustmentOptions{});
    ASSERT_EQ(test::run_to_end(*adjustment), Progress::kDone);
    expect_finite(*adjustment);
    EXPECT_EQ(adjustment->summary().outcome, AdjustmentOutcome::kConverged);
    for (const std::uint32_t i : behind) {
        EXPECT_TRUE(adjustment->is_outlier(i));
        EXPECT_EQ(adjustment->chi2(i), kAdjustChi2Far);
    }
    for (std::uint32_t i = 0; i < adjustment->keyframes(); ++i) {
        const Vector3 off = adjustment->pose(i).translation - window.true_poses[i].translation;
        EXPECT_LT(std::sqrt(off.squaredNorm()), 0.005);
    }
}

// Promise: an observation given again, any number of times, changes nothing but its own flag.
TEST(LocalAdjustment, DuplicatesHaveNoSay) {
    const Window window = make_window(WindowOptions{});
    Adjustment once(window.sizes());
    ASSERT_TRUE(window.load(*once));
    once->start(AdjustmentOptions{});
    ASSERT_EQ(test::run_to_end(*once), Progress::kDone);
    Window doubled = window;
    for (std::uint32_t i = 0; i < 3000; ++i) {
        AdjustmentObservation o = window.observations[i < 2000 ? 7 : i % window.observations.size()];
        o.x += 0.01;
        doubled.observations.push_back(o);
    }
    Adjustment twice(doubled.sizes());
    ASSERT_TRUE(doubled.load(*twice));
    twice->start(AdjustmentOptions{});
    Progress progress = Progress::kWorking;
    while (progress == Progress::kWorking) {
        WorkBudget budget(1);
        progress = twice->step(budget);
        ASSERT_LE(budget.units_spent(), LocalAdjustment::kPieceUnitsMax);
    }
    for (std::uint32_t i = 0; i < once->keyframes(); ++i) {
        EXPECT_NEAR((once->pose(i).translation - twice->pose(i).translation).squaredNorm(), 0.0, 1e-8);
    }
    EXPECT_EQ(twice->summary().first_round_cost, once->summary().first_round_cost);
    for (std::uint32_t i = 0; i < twice->observations(); ++i) {
        if (i >= once->observations()) {
            EXPECT_TRUE(twice->is_outlier(i));
            EXPECT_EQ(twice->chi2(i), kAdjustChi2Far);
        }
    }
}

// Promise: no parallax and no depth (every camera in one place) does no harm.
TEST(LocalAdjustment, NoParallax) {
    WindowOptions options;
    options.depth_share = 0;
    Window window = make_window(options);
    Random random(9);
    for (std::size_t i = 0; i < window.poses.size(); ++i) window.poses[i] = test::draw_motion(random, 0.0, 0.1);
    for (AdjustmentObservation& o : window.observations) {
        const Vector3 q = window.poses[o.keyframe].inverse() * window.true_points[o.point];
        o.x = q.x() / q.z();
        o.y = q.y() / q.z();
    }
    for (Vector3& p : window.points) p = 1.5 * p;
    Adjustment adjustment(window.sizes());
    ASSERT_TRUE(window.load(*adjustment));
    adjustment->start(AdjustmentOptions{});
    ASSERT_EQ(test::run_to_end(*adjustment), Progress::kDone);
    expect_finite(*adjustment);
    EXPECT_LE(adjustment->summary().final_cost, adjustment->summary().initial_cost);
}

// A finite number of any size, often an ordinary one.
double any_number(Random& random) {
    const double x = random.uniform(-1, 1);
    switch (random.below(8)) {
        case 0: return x * 1e308;
        case 1: return x * 1e150;
        case 2: return x * 1e-300;
        case 3: return 0.0;
        case 4: return x * 1e9;
        default: return x * 3.0;
    }
}

// Promise: finite garbage of any size ends in bounded work, finite, with every piece below its ceiling; and when no
// step helped, the input comes back bit for bit.
TEST(LocalAdjustment, GarbageEndsFinite) {
    std::uint32_t unchanged = 0, changed = 0;
    for (std::uint64_t seed = 1; seed <= 400; ++seed) {
        Random random(seed);
        const bool is_wild = random.below(2) == 0;
        Window window;
        const std::uint32_t keyframes = 1 + random.below(12);
        const std::uint32_t points = 1 + random.below(40);
        const std::uint32_t observations = random.below(400);
        for (std::uint32_t i = 0; i < keyframes; ++i) {
            SE3 pose = test::draw_motion(random, 1.0, 2.0);
            for (int k = 0; k < 3 && is_wild && random.below(4) == 0; ++k) pose.translation(k) = any_number(random);
            window.poses.push_back(pose);
            window.is_fixed.push_back(random.below(3) == 0);
        }
        for (std::uint32_t i = 0; i < points; ++i) {
            Vector3 p = test::draw_vector(random, 3.0);
            for (int k = 0; k < 3 && is_wild && random.below(4) == 0; ++k) p(k) = any_number(random);
            window.points.push_back(p);
        }
        for (std::uint32_t i = 0; i < observations; ++i) {
            AdjustmentObservation o;
            o.keyframe = random.below(keyframes);
            o.point = random.below(points);
            o.x = random.uniform(-1, 1);
            o.y = random.uniform(-1, 1);
            o.var_pixel = 1e-5;
            o.z_m = random.uniform(0, 4);
            o.var_z = random.below(2) == 0 ? 1e-3 : 0.0;
            if (is_wild && random.below(4) == 0) {
                o.x = any_number(random);
                o.y = any_number(random);
                o.z_m = any_number(random);
                o.var_pixel = std::abs(any_number(random)) + 1e-300;
                o.var_z = std::abs(any_number(random));
                if (o.var_z > 0 && o.var_z < 1e-300) o.var_z = 1e-300;
            }
            window.observations.push_back(o);
        }
        Adjustment adjustment(AdjustmentSizes{12, 12, points, observations});
        ASSERT_TRUE(window.load(*adjustment));
        AdjustmentOptions options;
        options.iterations_max[0] = random.below(20);
        options.iterations_max[1] = random.below(10);
        adjustment->start(options);
        Progress progress = Progress::kWorking;
        std::uint64_t spent = 0;
        while (progress == Progress::kWorking) {
            WorkBudget budget(1);
            progress = adjustment->step(budget);
            ASSERT_LE(budget.units_spent(), LocalAdjustment::kPieceUnitsMax);
            spent += budget.units_spent();
            ASSERT_LT(spent, 10'000'000U);
        }
        expect_finite(*adjustment);
        const AdjustmentSummary& s = adjustment->summary();
        EXPECT_LE(s.first_round_cost, s.initial_cost);
        if (s.steps_accepted == 0) {
            ++unchanged;
            EXPECT_TRUE(is_input(*adjustment, window));
        } else {
            ++changed;
            EXPECT_NE(s.outcome, AdjustmentOutcome::kUnchanged);
        }
    }
    EXPECT_GT(unchanged, 10U);
    EXPECT_GT(changed, 10U);
}

// Promise: the largest problem of every shape stays below the ceiling of a piece.
TEST(LocalAdjustment, LargestPieceIsBelowTheCeiling) {
    WindowOptions options;
    options.free = LocalAdjustment::kFreeKeyframesMax;
    options.fixed = LocalAdjustment::kKeyframesMax - options.free;
    options.points = 60;
    options.observations = options.points * LocalAdjustment::kKeyframesMax;
    const Window window = make_window(options);
    Adjustment adjustment(window.sizes());
    ASSERT_TRUE(window.load(*adjustment));
    adjustment->start(AdjustmentOptions{});
    Progress progress = Progress::kWorking;
    std::uint64_t largest = 0;
    while (progress == Progress::kWorking) {
        WorkBudget budget(1);
        progress = adjustment->step(budget);
        largest = std::max(largest, budget.units_spent());
    }
    EXPECT_LE(largest, LocalAdjustment::kPieceUnitsMax);
    EXPECT_GT(largest, LocalAdjustment::kPieceUnitsMax / 2);
}

// Promise: the bits are those seen on every compiler at every optimisation (run with gcc and clang at -O0 and -O2).
TEST(LocalAdjustment, GoldenBits) {
    StateHash hash;
    for (std::uint64_t seed = 1; seed <= 4; ++seed) {
        WindowOptions options;
        options.seed = seed;
        options.outlier_share = 0.05;
        options.depth_share = 0.7;
        const Window window = make_window(options);
        Adjustment adjustment(window.sizes());
        ASSERT_TRUE(window.load(*adjustment));
        adjustment->start(AdjustmentOptions{});
        ASSERT_EQ(test::run_to_end(*adjustment), Progress::kDone);
        for (const std::uint64_t word : results_of(*adjustment)) hash.add(word);
    }
    EXPECT_EQ(hash.value(), 13426401958657145249U);
}

}  // namespace
}  // namespace stillmesh::local_adjustment_test
