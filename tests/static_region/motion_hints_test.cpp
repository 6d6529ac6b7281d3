#include "engine/static_region/motion_hints.hpp"

#include <gtest/gtest.h>

#include <cmath>
#include <cstdint>
#include <limits>

#include "engine/geometry/se3.hpp"
#include "tests/support/synthetic.hpp"

namespace stillmesh::motion_hints_test {
namespace {

constexpr std::int64_t kStart_ns = 3'000'000'000;
constexpr std::int64_t kGap_ns = 33'000'000;

SE3 step_of(double x, double y, double z, double turn_y) {
    Vector6 xi;
    xi << x, y, z, 0, turn_y, 0;
    return se3_exp(xi);
}

MotionHint hint_of(const SE3& step, double sigma_m, double sigma_rad) {
    MotionHint out;
    out.last_from_camera = transform_of(step);
    out.sigma_m = sigma_m;
    out.sigma_rad = sigma_rad;
    return out;
}

RegionContext expectation(const SE3& pose, double sigma_m = 0.006, double sigma_rad = 0.03) {
    RegionContext out;
    out.world_from_camera_predicted = pose;
    out.prediction_sigma_m = sigma_m;
    out.prediction_sigma_rad = sigma_rad;
    return out;
}

// Clocks that go together.
Parameters one_clock() {
    Parameters out;
    out.hint.clock_s = 0;
    return out;
}

double radians_between(const SE3& a, const SE3& b) {
    return rotation_angle(a.rotation.transpose() * b.rotation);
}

// Promise: in the first second hints are chained from the start and decide alone, however sure the motion of the last
// frames is; their deviations are added up, beside the floor of the poses.
TEST(MotionHints, TheFirstSecondCountsFromTheStart) {
    const Parameters parameters = one_clock();
    const SE3 start = step_of(1, 2, 3, 0.4);
    const SE3 step = step_of(0.01, 0, 0.02, 0.03);
    MotionHints hints;
    hints.begin(start, kStart_ns);
    const MotionHint hint = hint_of(step, 0.001, 0.002);
    for (int i = 1; i <= 5; ++i) hints.take(&hint, kStart_ns + i * kGap_ns, parameters.hint);
    RegionContext expected = expectation(step_of(9, 9, 9, 1), 1e-4, 1e-4);
    hints.weigh_in(expected, true, parameters);
    const SE3 there = start * step * step * step * step * step;
    EXPECT_LT(test::metres_between(expected.world_from_camera_predicted, there), 1e-12);
    EXPECT_LT(radians_between(expected.world_from_camera_predicted, there), 1e-7);
    EXPECT_NEAR(expected.prediction_sigma_m, std::hypot(0.005, parameters.hint.floor_m), 1e-12);
    EXPECT_NEAR(expected.prediction_sigma_rad, std::hypot(0.010, parameters.hint.floor_rad), 1e-12);
    EXPECT_TRUE(expected.hint.is_whole);
    EXPECT_DOUBLE_EQ(expected.hint.sharpness_m, parameters.hint.young_sharpness);
    EXPECT_DOUBLE_EQ(expected.hint.sharpness_rad, parameters.hint.young_sharpness);
}

// Promise: later a hint and the camera's own motion meet between them, nearer to the surer one and surer than both; the
// choice is no sharper than it was.
TEST(MotionHints, LaterBothHaveASay) {
    Parameters parameters = one_clock();
    parameters.hint.floor_m = parameters.hint.floor_rad = 1e-9;
    MotionHints hints;
    hints.begin(SE3{}, kStart_ns);
    const MotionHint hint = hint_of(step_of(0.03, 0, 0, 0.03), 0.001, 0.02);
    hints.take(&hint, kStart_ns + kGap_ns, parameters.hint);
    RegionContext expected = expectation(SE3{}, 0.002, 0.01);
    hints.weigh_in(expected, false, parameters);
    const SE3& met = expected.world_from_camera_predicted;
    EXPECT_NEAR(met.translation.x(), 0.03 * 4 / 5, 1e-4);  // weights 1 / 1 and 1 / 4
    EXPECT_NEAR(rotation_angle(met.rotation), 0.03 * 1 / 5, 1e-6);
    EXPECT_NEAR(expected.prediction_sigma_m, 0.002 / std::sqrt(5.0), 1e-9);
    EXPECT_NEAR(expected.prediction_sigma_rad, 0.02 / std::sqrt(5.0), 1e-9);
    EXPECT_DOUBLE_EQ(expected.hint.sharpness_m, 1);
    EXPECT_DOUBLE_EQ(expected.hint.sharpness_rad, 1);
}

// Promise: clocks that are apart by clock_s are no contradiction: what the camera goes and turns in that time is
// allowed.
TEST(MotionHints, ClocksMayBeApart) {
    const double late_rad = 0.05 * HintParameters{}.clock_s / 0.033;  // at 1.5 rad/s
    for (const Parameters& parameters : {Parameters{}, one_clock()}) {
        MotionHints hints;
        hints.begin(SE3{}, kStart_ns);
        const MotionHint hint = hint_of(step_of(0, 0, 0, 0.05), 0, 0);
        hints.take(&hint, kStart_ns + kGap_ns, parameters.hint);
        const double off = hints.sigmas_off(step_of(0, 0, 0, 0.05 - late_rad), parameters.hint);
        EXPECT_EQ(off<1, parameters.hint.clock_s> 0) << off;
    }
}

// Promise: after a frame that was not sure, hints alone lead on from the last one that was.
TEST(MotionHints, WhatWasNotSureIsNoMotion) {
    const Parameters parameters;
    const SE3 step = step_of(0.02, 0, 0, 0);
    MotionHints hints;
    hints.begin(SE3{}, kStart_ns);
    const MotionHint hint = hint_of(step, 0.001, 0.001);
    for (int i = 1; i <= 2; ++i) hints.take(&hint, kStart_ns + i * kGap_ns, parameters.hint);
    RegionContext expected = expectation(step_of(0.2, 0, 0, 0));
    hints.weigh_in(expected, false, parameters);
    EXPECT_LT(test::metres_between(expected.world_from_camera_predicted, step * step), 1e-12);
}

// Promise: a gyroscope says nothing of the translation, which stays where the camera's own motion has it; in the first
// second that is as unsure as one that nothing is known of, since it may be a body's.
TEST(MotionHints, ARotationAloneLeavesTheTranslation) {
    const Parameters parameters = one_clock();
    MotionHints hints;
    hints.begin(SE3{}, kStart_ns);
    const MotionHint hint = hint_of(step_of(5, 5, 5, 0.1), -1, 0.001);
    hints.take(&hint, kStart_ns + kGap_ns, parameters.hint);
    for (const bool is_young : {false, true}) {
        RegionContext expected = expectation(step_of(0.03, 0, 0, 0));
        hints.weigh_in(expected, is_young, parameters);
        EXPECT_DOUBLE_EQ(expected.world_from_camera_predicted.translation.x(), 0.03);
        EXPECT_EQ(expected.prediction_sigma_m > 0.006, is_young);
        EXPECT_NEAR(rotation_angle(expected.world_from_camera_predicted.rotation), 0.1, is_young ? 1e-9 : 2e-3);
        EXPECT_FALSE(expected.hint.is_whole);
        EXPECT_DOUBLE_EQ(expected.hint.sharpness_rad, is_young ? parameters.hint.turn_sharpness : 1);
    }
}

// Promise: wheels that say nothing of the turn leave it to the camera's own motion, and their way counts as it is; an
// error of it is learned as theirs, and the turn's is not.
TEST(MotionHints, AWayAloneLeavesTheTurn) {
    const Parameters parameters = one_clock();
    const MotionHint hint = hint_of(step_of(0.03, 0, 0, 2), 0.001, -1);
    for (const bool is_young : {false, true}) {
        MotionHints hints;
        hints.begin(step_of(1, 0, 0, 0.3), kStart_ns);
        hints.take(&hint, kStart_ns + kGap_ns, parameters.hint);
        RegionContext expected = expectation(step_of(1, 0, 0, 0.35));
        hints.weigh_in(expected, is_young, parameters);
        const SE3& met = expected.world_from_camera_predicted;
        EXPECT_LT(radians_between(met, step_of(1, 0, 0, 0.35)), 1e-12) << "their turn of 2 rad is no turn";
        EXPECT_EQ(expected.prediction_sigma_rad, 0.03);
        SE3 way = pose_of(hint.last_from_camera);
        way.rotation.setIdentity();
        const SE3 there = step_of(1, 0, 0, 0.3) * way;
        if (is_young) {
            EXPECT_LT(test::metres_between(met, there), 1e-12);
        } else {
            const double before_m = test::metres_between(step_of(1, 0, 0, 0.35), there);
            EXPECT_LT(test::metres_between(met, there), 0.8 * before_m);
            EXPECT_GT(test::metres_between(met, there), 0.2 * before_m) << "both have a say";
        }
        EXPECT_TRUE(expected.hint.is_any);
        EXPECT_FALSE(expected.hint.is_whole);
        EXPECT_EQ(expected.hint.sharpness_m, is_young ? parameters.hint.young_sharpness : 1);
        EXPECT_EQ(expected.hint.sharpness_rad, 1);
        hints.learn(there * step_of(0.5, 0, 0, 1), parameters.hint);
        EXPECT_GT(hints.scale_translation(), 100);
        EXPECT_EQ(hints.scale_rotation(), 1);
    }
}

// Promise: a way is known as far as the turn before it is, a turn as far as every turn before it; once either is
// missing it stays so until there is another sure pose. By an oracle over all chains of three hints of every kind.
TEST(MotionHints, WhatIsMissingOnceIsMissing) {
    const Parameters parameters = one_clock();
    const SE3 step = step_of(0.1, 0, 0, 0.2);
    for (int kinds = 0; kinds < 64; ++kinds) {
        MotionHints hints;
        hints.begin(SE3{}, kStart_ns);
        bool has_way = true, has_turn = true;
        for (int i = 0; i < 3; ++i) {
            const bool is_way = (kinds >> (2 * i) & 1) != 0, is_turn = (kinds >> (2 * i + 1) & 1) != 0;
            const MotionHint hint = hint_of(step, is_way ? 0.001 : -1, is_turn ? 0.001 : -1);
            hints.take(&hint, kStart_ns + (i + 1) * kGap_ns, parameters.hint);
            has_way = has_way && is_way && (i == 0 || has_turn);
            has_turn = has_turn && is_turn;
            RegionContext expected = expectation(step_of(-7, 0, 0, -1));
            hints.weigh_in(expected, true, parameters);
            SE3 there;
            for (int k = 0; k <= i; ++k) there = there * step;
            const SE3& met = expected.world_from_camera_predicted;
            EXPECT_EQ(hints.is_any(), has_way || has_turn) << kinds;
            EXPECT_EQ(expected.hint.is_whole, has_way && has_turn) << kinds;
            EXPECT_EQ(radians_between(met, there) < 1e-7, has_turn) << kinds;
            EXPECT_EQ(test::metres_between(met, there) < 1e-9, has_way) << kinds << " after " << i;
            if (!has_way) {
                EXPECT_LT(test::metres_between(met, step_of(-7, 0, 0, -1)), 1e-12) << kinds;
            }
            // Off by what is known alone: a pose that is wrong in what no hint tells is no contradiction.
            SE3 wrong = there;
            if (!has_way) wrong.translation += Vector3(5, 0, 0);
            if (!has_turn) wrong.rotation = wrong.rotation * so3_exp(Vector3(0, 1, 0));
            EXPECT_LT(hints.sigmas_off(wrong, parameters.hint), 1e-3) << kinds << " after " << i;
        }
    }
}

// Promise: a frame without a hint, or chain_s since the last sure pose, and what is expected stays as it is, bit by
// bit, until there is another sure pose.
TEST(MotionHints, AChainWithAHoleSaysNothing) {
    const Parameters parameters;
    const MotionHint hint = hint_of(step_of(0.02, 0, 0, 0.1), 0.001, 0.001);
    const auto is_heard = [&](const MotionHints& hints) {
        RegionContext expected = expectation(SE3{});
        hints.weigh_in(expected, false, parameters);
        EXPECT_EQ(expected.hint.is_any, hints.is_any());
        EXPECT_EQ(expected.world_from_camera_predicted.translation.x() != 0, hints.is_any());
        return hints.is_any();
    };
    MotionHints hints;
    hints.begin(SE3{}, kStart_ns);
    EXPECT_FALSE(is_heard(hints));
    hints.take(&hint, kStart_ns + kGap_ns, parameters.hint);
    EXPECT_TRUE(is_heard(hints));
    hints.take(nullptr, kStart_ns + 2 * kGap_ns, parameters.hint);
    EXPECT_FALSE(is_heard(hints));
    hints.take(&hint, kStart_ns + 3 * kGap_ns, parameters.hint);
    EXPECT_FALSE(is_heard(hints));
    EXPECT_EQ(hints.sigmas_off(step_of(1, 0, 0, 0), parameters.hint), 0);
    hints.begin(SE3{}, kStart_ns + 3 * kGap_ns);
    hints.take(&hint, kStart_ns + 4 * kGap_ns, parameters.hint);
    EXPECT_TRUE(is_heard(hints));
    const auto late_ns = static_cast<std::int64_t>(parameters.hint.chain_s * 1e9) + 4 * kGap_ns;
    hints.take(&hint, kStart_ns + late_ns, parameters.hint);
    EXPECT_FALSE(is_heard(hints));
}

// One frame: the hint says `step`, the picture `found`.
void frame(MotionHints& hints, const MotionHint& hint, const SE3& found, const HintParameters& parameters) {
    hints.begin(SE3{}, kStart_ns);
    hints.take(&hint, kStart_ns + kGap_ns, parameters);
    hints.learn(found, parameters);
}

// Promise: deviations that are five times too small are believed as little as they deserve: the scale on the variance
// comes to lie between 25 and what its largest surprise was; honest ones keep their weight.
TEST(MotionHints, WrongDeviationsAreFoundOut) {
    const HintParameters parameters;
    for (const double excess : {1.0, 5.0}) {
        Random random(7);
        MotionHints hints;
        double scale_sum = 0;
        for (int i = 0; i < 400; ++i) {
            const double sigma = 0.01;
            const SE3 off = step_of(excess * sigma * random.normal(), excess * sigma * random.normal(),
                                    excess * sigma * random.normal(), 0);
            frame(hints, hint_of(SE3{}, sigma, 0.01), off, parameters);
            scale_sum += i >= 100 ? hints.scale_translation() : 0;
        }
        EXPECT_GE(scale_sum / 300, excess * excess);
        EXPECT_LT(scale_sum / 300, excess == 1 ? 1.5 : 100);
        EXPECT_DOUBLE_EQ(hints.scale_rotation(), 1);
    }
}

// Promise: a wheel that slips is believed less from the first sure frame on, by as much as it was off, and again once
// it grips; meanwhile what is expected stays near the camera's own motion.
TEST(MotionHints, ASlipIsForgottenInTheEnd) {
    const Parameters parameters;
    const MotionHint standing = hint_of(SE3{}, 0.0005, 0.0005);
    const SE3 moved = step_of(0.05, 0, 0, 0);
    MotionHints hints;
    frame(hints, standing, moved, parameters.hint);
    EXPECT_GT(hints.scale_translation(), 3000);  // a hundred deviations off: their square, by axis
    hints.begin(moved, kStart_ns);
    hints.take(&standing, kStart_ns + kGap_ns, parameters.hint);
    RegionContext expected = expectation(moved * moved);
    hints.weigh_in(expected, false, parameters);
    EXPECT_LT(test::metres_between(expected.world_from_camera_predicted, moved * moved), 0.005);
    EXPECT_LT(hints.sigmas_off(moved * moved, parameters.hint), 2);
    for (int i = 0; i < 90; ++i) frame(hints, standing, SE3{}, parameters.hint);
    EXPECT_DOUBLE_EQ(hints.scale_translation(), 1);
    EXPECT_GT(hints.sigmas_off(moved, parameters.hint), parameters.hint.contradiction_sigmas);
}

// Promise: a hint that claims to be exact, and one that is off by any size, leave finite numbers.
TEST(MotionHints, WhatClaimsToBeExactDoesNoHarm) {
    const Parameters parameters;
    MotionHints hints;
    for (const double off : {1e-9, 1.0, 900.0}) {
        frame(hints, hint_of(SE3{}, 0, 0), step_of(off, 0, 0, 1), parameters.hint);
        RegionContext expected = expectation(SE3{});
        hints.take(nullptr, kStart_ns, parameters.hint);
        hints.begin(SE3{}, kStart_ns);
        const MotionHint hint = hint_of(step_of(off, 0, 0, 0), 0, 0);
        hints.take(&hint, kStart_ns + kGap_ns, parameters.hint);
        hints.weigh_in(expected, false, parameters);
        EXPECT_TRUE(expected.world_from_camera_predicted.translation.allFinite());
        EXPECT_TRUE(std::isfinite(expected.prediction_sigma_m) && expected.prediction_sigma_m > 0);
        EXPECT_TRUE(std::isfinite(expected.prediction_sigma_rad) && expected.prediction_sigma_rad > 0);
    }
}

// Promise: where the map moves under the camera, what hints count from moves along.
TEST(MotionHints, TheMapMovesUnderThem) {
    const Parameters parameters;
    const SE3 correction = step_of(0.5, 0.2, -0.3, 0.2);
    const SE3 start = step_of(1, 0, 0, 0.1);
    const SE3 step = step_of(0.01, 0, 0, 0);
    MotionHints hints;
    hints.begin(start, kStart_ns);
    hints.follow(correction);
    const MotionHint hint = hint_of(step, 0.001, 0.001);
    hints.take(&hint, kStart_ns + kGap_ns, parameters.hint);
    EXPECT_LT(hints.sigmas_off(correction * start * step, parameters.hint), 1e-4);
}

// Promise: hints with what is no number, no unit quaternion or no size of a frame's motion are told from good ones.
TEST(MotionHints, WhatIsNoHintIsRefused) {
    const MotionHint good = hint_of(step_of(0.1, 0, 0, 2), 0.1, -1);
    EXPECT_TRUE(is_valid(good));
    EXPECT_TRUE(is_valid(MotionHint{}));
    for (const double bad :
         {std::numeric_limits<double>::quiet_NaN(), std::numeric_limits<double>::infinity(), 1e300}) {
        for (int i = 0; i < 9; ++i) {
            MotionHint hint = good;
            if (i < 4) hint.last_from_camera.rotation_xyzw[i] = bad;
            if (i >= 4 && i < 7) hint.last_from_camera.translation_m[i - 4] = bad;
            if (i == 7) hint.sigma_m = bad;
            if (i == 8) hint.sigma_rad = bad;
            EXPECT_FALSE(is_valid(hint)) << i << ' ' << bad;
        }
    }
    MotionHint hint = good;
    hint.last_from_camera.rotation_xyzw[3] += 0.01;
    EXPECT_FALSE(is_valid(hint));
}

}  // namespace
}  // namespace stillmesh::motion_hints_test
