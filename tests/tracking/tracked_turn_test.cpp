// The turn during a frame, as tracking carries rows with it.
#include <gtest/gtest.h>

#include <algorithm>
#include <cstddef>
#include <vector>

#include "tests/support/synthetic.hpp"
#include "tests/tracking/shutter_rig.hpp"

namespace stillmesh {
namespace {

using test::kPeriod_s;
using test::kReadout_s;

class Turn : public test::ShutterRig {};

// Promise: turns that change from frame to frame are the camera's: rows are carried with them nearly whole.
TEST_F(Turn, ATremblingHandIsCarried) {
    start_given();
    Random random(3);
    double along = 0, square = 0;
    for (int frame = 0; frame < 200; ++frame) {
        const Vector3 off = test::random_normal_vector(random, 0.005);
        const Vector3 carried = turned(off, random);
        if (frame < 20) continue;
        along += carried.dot(off);
        square += off.squaredNorm();
    }
    EXPECT_GT(along, 0.8 * square);
    EXPECT_LT(along, 1.02 * square);
}

// Promise: what stays from frame to frame is the map's, whose points were carried otherwise: rows are not bent after
// it.
TEST_F(Turn, WhatStaysIsNotCarried) {
    start_given();
    Random random(4);
    const Vector3 off(0.005, -0.004, 0.006);
    for (int frame = 0; frame < 100; ++frame) static_cast<void>(turned(off, random));
    double along = 0;
    for (int frame = 0; frame < 20; ++frame) along += turned(off, random).dot(off) / 20;
    EXPECT_LT(along, 0.2 * off.squaredNorm());
    // And where a hand trembles over it, what trembles is carried.
    double trembling = 0, square = 0;
    for (int frame = 0; frame < 400; ++frame) {
        const Vector3 tremble = test::random_normal_vector(random, 0.005);
        const Vector3 carried = turned(off + tremble, random);
        if (frame < 300) continue;
        trembling += carried.dot(tremble);
        square += tremble.squaredNorm();
    }
    EXPECT_GT(trembling, 0.4 * square) << "half of the variance stays";
}

// Promise: a camera that does not tremble is soon believed not to: after 300 frames its rows stay within a third of a
// milliradian of its motion's, and a turn as of a trembling hand that shows once is not followed.
TEST_F(Turn, AQuietCameraIsBelieved) {
    for (const double readout_s : {0.0, kReadout_s}) {
        start_given(readout_s);
        Random random(5);
        double worst_rad = 0;
        for (int frame = 0; frame < 320; ++frame) {
            const Vector3 carried = turned(Vector3::Zero(), random, true, readout_s);
            if (frame >= 300) worst_rad = std::max(worst_rad, carried.cwiseAbs().maxCoeff());
        }
        EXPECT_LT(worst_rad, 0.0003) << readout_s;
        const Vector3 once(0, 0, 0.002);
        EXPECT_LT(turned(once, random, false, readout_s).z(), 0.25 * once.z()) << readout_s;
    }
}

// Promise: frames that do not count teach nothing of how the camera trembles.
TEST_F(Turn, ATurnThatDoesNotCountTeachesNothing) {
    const auto carried_after = [&](int frames) {
        start_given();
        Random random(6);
        for (int frame = 0; frame < frames; ++frame) static_cast<void>(turned(Vector3::Zero(), random, false));
        Random another(7);
        return turned(Vector3(0.003, 0, 0), another);
    };
    EXPECT_EQ((carried_after(0) - carried_after(50)).norm(), 0);
}

// Promise: with too few matches, or none, nothing is measured: the camera sweeps as its motion makes expect, also where
// the frame before had measured a turn.
TEST_F(Turn, TooFewMatchesMeasureNothing) {
    start_given();
    Random random(8);
    static_cast<void>(turned(Vector3(0.005, 0, 0), random));
    for (const std::size_t matches : {0U, 29U}) {
        shutter_.begin_frame();
        shutter_.set_motion(se3_exp(speed_ * kPeriod_s), kPeriod_s);
        carry();
        EXPECT_FALSE(measure_turn(matches));
        EXPECT_LT((shutter_.sweep() - speed_ * kReadout_s).cwiseAbs().maxCoeff(), 1e-12);
        EXPECT_LT((shutter_.speed() - speed_).cwiseAbs().maxCoeff(), 1e-9);
    }
    EXPECT_TRUE(measure_turn(30));
    EXPECT_GT((shutter_.sweep() - speed_ * kReadout_s).cwiseAbs().maxCoeff(), 1e-4);
}

// Promise: after reset() nothing is left of how the camera trembled: the same frames give the same bits.
TEST_F(Turn, ResetForgetsTheTurns) {
    start_given();
    const auto carried = [&] {
        Random random(9);
        std::vector<double> out;
        for (int frame = 0; frame < 30; ++frame) {
            const Vector3 turn = turned(test::random_normal_vector(random, 0.005), random);
            for (int k = 0; k < 3; ++k) out.push_back(turn(k));
        }
        return out;
    };
    const std::vector<double> first = carried();
    EXPECT_NE(carried(), first);
    shutter_.reset();
    EXPECT_EQ(shutter_.sweep().cwiseAbs().maxCoeff(), 0);
    EXPECT_EQ(carried(), first);
}

// Promise: speed() is the motion's, whatever the rows show; a turn that was measured stays when the motion is said
// anew, until the next frame begins.
TEST_F(Turn, TheMotionSaysTheSpeedAndTheRowsTheTurn) {
    start_given();
    Random random(10);
    const Vector3 carried = turned(Vector3(0.004, -0.003, 0.005), random);
    EXPECT_GT(carried.norm(), 0.002);
    EXPECT_LT((shutter_.speed() - speed_).cwiseAbs().maxCoeff(), 1e-9);
    const Vector3 turn = shutter_.sweep().tail<3>();
    shutter_.set_motion(se3_exp(speed_ * (2 * kPeriod_s)), kPeriod_s);
    EXPECT_LT((shutter_.speed() - 2 * speed_).cwiseAbs().maxCoeff(), 1e-9);
    EXPECT_LT((shutter_.sweep().head<3>() - 2 * kReadout_s * speed_.head<3>()).norm(), 1e-12);
    EXPECT_EQ((shutter_.sweep().tail<3>() - turn).norm(), 0);
    shutter_.begin_frame();
    shutter_.set_motion(se3_exp(speed_ * kPeriod_s), kPeriod_s);
    EXPECT_LT((shutter_.sweep() - speed_ * kReadout_s).cwiseAbs().maxCoeff(), 1e-12);
}

// Promise: a hand that trembles takes less than a fifth of the readout, which is learnt from what the motion explains.
TEST_F(Turn, TheReadoutIsFoundUnderATremblingHand) {
    see(kReadout_s);
    Random random(11);
    MotionModel motion;
    for (int frame = 0; frame < 200; ++frame) {
        static_cast<void>(turned(test::random_normal_vector(random, 0.005), random));
        shutter_.adopt(world_->map(), motion);
    }
    EXPECT_NEAR(shutter_.readout_s(), kReadout_s, 0.2 * kReadout_s);
}

}  // namespace
}  // namespace stillmesh
