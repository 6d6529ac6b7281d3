// The turn during a frame, as tracking carries rows with it.
#include <gtest/gtest.h>

#include <cmath>
#include <cstddef>
#include <vector>

#include "tests/support/synthetic.hpp"
#include "tests/tracking/shutter_rig.hpp"

namespace stillmesh::tracked_turn_test {
namespace {

using test::kPeriod_s;
using test::kReadout_s;

constexpr double kNothing = 1e-12;  // rad

class Turn : public test::ShutterRig {
protected:
    void tremble(Random& random) {
        for (int frame = 0; frame < 20; ++frame)
            static_cast<void>(turned(test::random_normal_vector(random, 0.005), random));
    }
};

// Promise: turns that change from frame to frame are the camera's: rows are carried with them.
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
    EXPECT_GT(along, 0.9 * square);
    EXPECT_LT(along, 1.02 * square);
}

// Promise: what stays from frame to frame is the map's, whose points were carried otherwise: rows are not bent after
// it. Nor are they behind a global shutter that is given, however much frames are off.
TEST_F(Turn, WhatStaysIsNotCarried) {
    start_given();
    Random random(4);
    for (int frame = 0; frame < 100; ++frame)
        ASSERT_LT(turned(Vector3(0.005, -0.004, 0.006), random).norm(), kNothing) << frame;
    start_given(0);
    for (int frame = 0; frame < 50; ++frame) {
        shutter_.begin_frame();
        EXPECT_FALSE(measure_turn());
    }
}

// Promise: the rows of a camera that does not tremble stay where its motion has them, and a turn as of a trembling hand
// that shows once is not followed.
TEST_F(Turn, AQuietCameraIsBelieved) {
    start_given();
    Random random(5);
    for (int frame = 0; frame < 320; ++frame) ASSERT_LT(turned(Vector3::Zero(), random).norm(), kNothing) << frame;
    EXPECT_LT(turned(Vector3(0, 0, 0.01), random).norm(), kNothing);
}

// Promise: until the camera is found to tremble every frame says whether it does, since few of them are sure before;
// from then on those that do not count, as those of a camera that may follow a body, teach nothing of it.
TEST_F(Turn, FramesThatDoNotCountTeachUntilItIsFound) {
    start_given();
    Random random(6);
    int frames = 0;
    while (!shutter_.is_trembling() && frames < 50) {
        static_cast<void>(turned(test::random_normal_vector(random, 0.005), random, false));
        ++frames;
    }
    ASSERT_TRUE(shutter_.is_trembling());
    EXPECT_GE(frames, 5);
    EXPECT_GT(turned(Vector3(0.003, 0, 0), random).norm(), 0.002);
    for (const bool counts : {false, true}) {
        for (int frame = 0; frame < 300; ++frame) static_cast<void>(turned(Vector3::Zero(), random, counts));
        EXPECT_EQ(shutter_.is_trembling(), !counts);
    }
}

// Promise: with too few matches, or none, nothing is measured: the camera sweeps as its motion makes expect, also where
// the frame before had measured a turn.
TEST_F(Turn, TooFewMatchesMeasureNothing) {
    start_given();
    Random random(8);
    tremble(random);
    ASSERT_GT(turned(Vector3(0.005, 0, 0), random).norm(), 0.002);
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
    tremble(random);
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

// Promise: under a trembling hand the readout is learnt from the steady part of the motion. A hand at 10 Hz is .83
// times as fast from frame to frame as within the frame and 60 degrees behind: by its rows alone less than half of the
// readout would be found.
TEST_F(Turn, TheReadoutIsFoundUnderATremblingHand) {
    see(kReadout_s);
    Random random(11);
    MotionModel motion;
    const Vector6 steady = speed_;
    for (int frame = 0; frame < 300; ++frame) {
        const double phase = 2 * 3.141592653589793 * 10 * frame / 30;
        const Vector3 axis(0.5, 0.3, -0.4);
        speed_.tail<3>() = steady.tail<3>() + axis * (0.83 * std::cos(phase - 3.141592653589793 / 3));
        static_cast<void>(turned((axis * std::cos(phase) + steady.tail<3>() - speed_.tail<3>()) * kReadout_s, random));
        shutter_.adopt(world_->map(), motion);
    }
    EXPECT_NEAR(shutter_.readout_s(), kReadout_s, 0.2 * kReadout_s);
}

}  // namespace
}  // namespace stillmesh::tracked_turn_test
