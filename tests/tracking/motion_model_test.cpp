#include "engine/tracking/motion_model.hpp"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <cstdint>

#include "tests/support/synthetic.hpp"

namespace stillmesh::motion_model_test {
namespace {

constexpr std::int64_t kStart_ns = 5'000'000'000;
constexpr std::int64_t kGap_ns = 40'000'000;
constexpr double kGap_s = 0.04;

Vector6 twist(double x, double y, double z, double a, double b, double c) {
    Vector6 out;
    out << x, y, z, a, b, c;
    return out;
}

Vector6 random_twist(Random& random) {
    Vector6 out;
    out.head<3>() = test::random_vector(random, 0.05);
    out.tail<3>() = test::random_vector(random, 0.1);
    return out;
}

// A camera at `pose` that moved by `xi`, in its own frame, over the last kGap_ns.
MotionModel moving(const SE3& pose, const Vector6& xi) {
    MotionModel out;
    out.begin_after(kStart_ns - 2 * kGap_ns);
    out.move_to(pose * se3_exp(xi).inverse());
    out.end_frame(kStart_ns - kGap_ns);
    out.move_to(pose);
    out.set_has_velocity(true);
    out.end_frame(kStart_ns);
    return out;
}

void expect_same(const SE3& a, const SE3& b, double tolerance = 1e-12) {
    EXPECT_LT(test::metres_between(a, b), tolerance);
    EXPECT_LT((a.rotation - b.rotation).cwiseAbs().maxCoeff(), tolerance);
}

// Promise: a camera that goes on as it did is predicted exactly, whatever screw it is on and whenever the next frame
// comes, up to gap_max of its interval; from there on the prediction waits.
TEST(MotionModel, ConstantVelocityIsExact) {
    Random random(1);
    for (int round = 0; round < 50; ++round) {
        const SE3 pose = test::random_motion(random, 3, 2);
        const Vector6 xi = random_twist(random);
        const MotionModel motion = moving(pose, xi);
        PredictionParameters p;
        p.gap_max = random.uniform(0.5, 4);
        for (const double gaps : {0.25, 0.5, 1.0, 2.0, 3.5, 100.0}) {
            const auto time_ns = kStart_ns + static_cast<std::int64_t>(gaps * kGap_ns);
            const MotionModel::Prediction predicted = motion.predict(time_ns, p, 0, true);
            expect_same(predicted.world_from_camera, pose * se3_exp(xi * std::min(gaps, p.gap_max)), 1e-11);
        }
    }
}

// Promise: of the velocity a share `fading` is left per frame that was not measured, however many there were.
TEST(MotionModel, WhatIsNotMeasuredFades) {
    const SE3 pose = se3_exp(twist(1, 2, 3, 0.4, -0.2, 0.7));
    const Vector6 xi = twist(0.03, -0.01, 0.02, 0.05, 0.01, -0.02);
    const MotionModel motion = moving(pose, xi);
    for (const double fading : {0.0, 0.5, 0.8, 0.99}) {
        PredictionParameters p;
        p.fading = fading;
        for (const std::uint32_t lost : {0U, 1U, 2U, 3U, 4U, 19U, 20U, 1000U, 4000000000U}) {
            expect_same(motion.predict(kStart_ns + kGap_ns, p, lost, true).world_from_camera,
                        pose * se3_exp(xi * std::pow(fading, lost)), 1e-9);
        }
    }
}

// Promise: after a choice that was not sure a camera slides on by `fading` only, and turns on in full.
TEST(MotionModel, UnsureSlidesLessAndTurnsOn) {
    const SE3 pose = se3_exp(twist(1, 2, 3, 0.4, -0.2, 0.7));
    const Vector6 xi = twist(0.03, -0.01, 0.02, 0.05, 0.01, -0.02);
    const MotionModel motion = moving(pose, xi);
    for (const double fading : {0.0, 0.3, 0.7}) {
        PredictionParameters p;
        p.fading = fading;
        Vector6 expected = xi;
        for (int i = 0; i < 3; ++i) expected(i) *= fading;
        expect_same(motion.predict(kStart_ns + kGap_ns, p, 0, false).world_from_camera, pose * se3_exp(expected));
        expect_same(motion.predict(kStart_ns + kGap_ns, p, 2, false).world_from_camera,
                    pose * se3_exp(expected * (p.fading * p.fading)));
        expect_same(motion.predict(kStart_ns + kGap_ns, p, 0, true).world_from_camera, pose * se3_exp(xi));
    }
}

// Promise: without a velocity the camera is expected where it was, with the deviations of that case; with one, with
// those of constant velocity. Both grow with the time since the last frame, and nothing else.
TEST(MotionModel, DeviationsGrowWithTheTime) {
    PredictionParameters p;
    p.sigma_m = 0.002;
    p.sigma_m_s = 0.3;
    p.sigma_rad = 0.005;
    p.sigma_rad_s = 0.7;
    p.still_sigma_m = 0.011;
    p.still_sigma_m_s = 1.3;
    p.still_sigma_rad_s = 1.9;
    const SE3 pose = se3_exp(twist(1, 2, 3, 0.4, -0.2, 0.7));
    MotionModel motion = moving(pose, twist(0.03, 0, 0, 0.05, 0, 0));
    for (const bool has_velocity : {true, false}) {
        motion.set_has_velocity(has_velocity);
        EXPECT_EQ(motion.has_velocity(), has_velocity);
        for (const double gaps : {0.5, 1.0, 10.0}) {
            const double dt = gaps * kGap_s;
            const auto time_ns = kStart_ns + static_cast<std::int64_t>(gaps * kGap_ns);
            for (const std::uint32_t lost : {0U, 5U}) {
                const MotionModel::Prediction predicted = motion.predict(time_ns, p, lost, lost == 0);
                EXPECT_NEAR(predicted.sigma_m, has_velocity ? 0.002 + 0.3 * dt : 0.011 + 1.3 * dt, 1e-12);
                EXPECT_NEAR(predicted.sigma_rad, has_velocity ? 0.005 + 0.7 * dt : 0.005 + 1.9 * dt, 1e-12);
                if (!has_velocity) {
                    expect_same(predicted.world_from_camera, pose);
                    EXPECT_EQ(predicted.rotation_speed_rad_s, 0);
                }
            }
        }
    }
}

// Promise: how fast the camera turns is the angle between its last two poses over the time between them, however it
// slides.
TEST(MotionModel, HowFastItTurns) {
    for (const double turn_rad : {0.0, 0.01, 0.02, 0.1, 1.0}) {
        const MotionModel motion = moving(SE3{}, twist(0.5, 0, 0, 0.6 * turn_rad, 0, 0.8 * turn_rad));
        EXPECT_NEAR(motion.predict(kStart_ns + 3 * kGap_ns, {}, 4, false).rotation_speed_rad_s, turn_rad / kGap_s,
                    1e-9);
    }
}

// Promise: when the world is corrected under the camera its prediction is corrected with it, and ten thousand
// corrections leave rotations rotations.
TEST(MotionModel, FollowsTheMap) {
    Random random(2);
    const PredictionParameters p;
    MotionModel motion = moving(test::random_motion(random, 2, 1), random_twist(random));
    for (int round = 0; round < 10'000; ++round) {
        const SE3 correction = test::random_motion(random, 1, 1);
        const SE3 before = motion.predict(kStart_ns + kGap_ns, p, 1, false).world_from_camera;
        motion.follow(correction);
        expect_same(motion.predict(kStart_ns + kGap_ns, p, 1, false).world_from_camera, correction * before, 1e-8);
    }
    for (const SE3& pose : {motion.world_from_camera(), motion.world_from_camera_previous()}) {
        EXPECT_LT((pose.rotation * pose.rotation.transpose() - Matrix3::Identity()).cwiseAbs().maxCoeff(), 3e-15);
    }
}

// Promise: amending changes both poses in the camera's own frame, each by its own increment.
TEST(MotionModel, AmendsBothPoses) {
    Random random(3);
    const SE3 pose = test::random_motion(random, 2, 1);
    const Vector6 xi = random_twist(random);
    MotionModel motion = moving(pose, xi);
    const SE3 change = test::random_motion(random, 0.1, 0.1), change_previous = test::random_motion(random, 0.1, 0.1);
    motion.amend(change, change_previous);
    expect_same(motion.world_from_camera(), pose * change);
    expect_same(motion.world_from_camera_previous(), pose * se3_exp(xi).inverse() * change_previous);
    for (int round = 0; round < 10'000; ++round) motion.amend(change, change_previous);
    for (const SE3& amended : {motion.world_from_camera(), motion.world_from_camera_previous()}) {
        EXPECT_LT((amended.rotation * amended.rotation.transpose() - Matrix3::Identity()).cwiseAbs().maxCoeff(), 3e-15);
    }
}

// Promise: a new map begins at its origin and a loaded one at its own time, both without a velocity; a frame's time is
// learnt when it ends; reset forgets all.
TEST(MotionModel, BeginsAtRest) {
    Random random(4);
    MotionModel motion = moving(test::random_motion(random, 2, 1), random_twist(random));
    EXPECT_EQ(motion.time_ns(), kStart_ns);
    motion.end_frame(kStart_ns + 7);
    EXPECT_EQ(motion.time_ns(), kStart_ns + 7);
    motion.begin_at(SE3{});
    EXPECT_FALSE(motion.has_velocity());
    EXPECT_EQ(motion.time_ns(), kStart_ns + 7);
    expect_same(motion.world_from_camera(), SE3{});
    expect_same(motion.world_from_camera_previous(), SE3{});

    motion = moving(test::random_motion(random, 2, 1), random_twist(random));
    const SE3 pose = motion.world_from_camera();
    motion.begin_after(42);
    EXPECT_FALSE(motion.has_velocity());
    EXPECT_EQ(motion.time_ns(), 42);
    expect_same(motion.world_from_camera(), pose);

    motion = moving(pose, random_twist(random));
    motion.reset();
    EXPECT_FALSE(motion.has_velocity());
    EXPECT_EQ(motion.time_ns(), 0);
    expect_same(motion.world_from_camera(), SE3{});
    expect_same(motion.world_from_camera_previous(), SE3{});
}

}  // namespace
}  // namespace stillmesh::motion_model_test
