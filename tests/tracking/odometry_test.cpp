#include "engine/tracking/odometry.hpp"

#include <gtest/gtest.h>

#include <cmath>
#include <cstdint>

#include "tests/support/synthetic.hpp"

namespace stillmesh::odometry_test {
namespace {

SE3 pose_by_quaternion(const RigidTransform& transform) {
    SE3 out;
    Vector4 q;
    for (int i = 0; i < 4; ++i) q(i) = transform.rotation_xyzw[i];
    out.rotation = Eigen::Quaterniond(q).toRotationMatrix();
    for (int i = 0; i < 3; ++i) out.translation(i) = transform.translation_m[i];
    return out;
}

void expect_same(const SE3& a, const SE3& b, double tolerance = 1e-9) {
    EXPECT_LT(test::metres_between(a, b), tolerance);
    EXPECT_LT((a.rotation - b.rotation).cwiseAbs().maxCoeff(), tolerance);
}

// The two transforms of a pose, which together are the pose.
struct Split {
    SE3 map_from_odom, odom_from_camera;
    Split(const Odometry& odometry, const SE3& world_from_camera) {
        PoseEstimate estimate;
        estimate.map_from_odom.translation_m[0] = 77;  // from a frame before
        odometry.split(world_from_camera, estimate);
        map_from_odom = pose_by_quaternion(estimate.map_from_odom);
        odom_from_camera = pose_by_quaternion(estimate.odom_from_camera);
        expect_same(map_from_odom * odom_from_camera, world_from_camera);
    }
};

// How far the two transforms together are from the pose. Inverses are transposes: what a rotation has lost of being one
// shows here.
double rotation_error(const Odometry& odometry, const SE3& pose) {
    const Split split(odometry, pose);
    return ((split.map_from_odom * split.odom_from_camera).rotation - pose.rotation).cwiseAbs().maxCoeff();
}

// Promise: without a jump odometry is the map's frame, to the last bit.
TEST(Odometry, IsTheMapUntilItJumps) {
    Random random(1);
    const Odometry odometry;
    for (int i = 0; i < 20; ++i) {
        const SE3 pose = test::random_motion(random, 5, 2);
        PoseEstimate estimate;
        estimate.map_from_odom.translation_m[1] = 3;
        odometry.split(pose, estimate);
        const RigidTransform identity;
        for (int k = 0; k < 3; ++k) {
            EXPECT_EQ(estimate.map_from_odom.translation_m[k], 0);
            EXPECT_EQ(estimate.odom_from_camera.translation_m[k], pose.translation(k));
        }
        for (int k = 0; k < 4; ++k) {
            EXPECT_EQ(estimate.map_from_odom.rotation_xyzw[k], identity.rotation_xyzw[k]);
        }
        expect_same(pose_by_quaternion(estimate.odom_from_camera), pose, 1e-12);
    }
}

// Promise: whatever the map does under the camera, odom_from_camera goes on without a jump, map_from_odom takes it all,
// and the pose in the map is their product; ten thousand jumps leave a rotation.
TEST(Odometry, GoesOnWhereTheMapJumps) {
    Random random(2);
    Odometry odometry;
    SE3 pose = test::random_motion(random, 5, 2);
    for (int i = 0; i < 10'000; ++i) {
        const SE3 before = Split(odometry, pose).odom_from_camera;
        const SE3 correction = test::random_motion(random, 0.1, 0.1);
        odometry.jump(correction);
        pose = correction * pose;
        renormalise(pose.rotation);
        expect_same(Split(odometry, pose).odom_from_camera, before);
        const SE3 step = test::random_motion(random, 0.05, 0.05);  // and a frame's motion is the same in both
        expect_same(Split(odometry, pose * step).odom_from_camera, before * step);
    }
    EXPECT_LT(rotation_error(odometry, pose), 3e-15);
}

// Promise: a camera that is found elsewhere has not moved as far as odometry knows, also after earlier jumps.
TEST(Odometry, IsFoundElsewhereWithoutMoving) {
    Random random(3);
    Odometry odometry;
    SE3 pose = test::random_motion(random, 5, 2);
    for (int i = 0; i < 10'000; ++i) {
        const SE3 before = Split(odometry, pose).odom_from_camera;
        const SE3 found = test::random_motion(random, 5, 2);
        odometry.jump_to(found, pose);
        expect_same(Split(odometry, found).odom_from_camera, before);
        pose = found;
    }
    EXPECT_LT(rotation_error(odometry, pose), 3e-15);
}

// A camera that is moved from one pose to the next within a tenth of a second.
MotionModel moved(const SE3& from, const SE3& to) {
    MotionModel out;
    out.begin_after(900'000'000);
    out.move_to(from);
    out.end_frame(1'000'000'000);
    out.move_to(to);
    return out;
}

// Promise: a tracked frame adds drift_share of its step to the drift, an unsure one three times that; both add step and
// turn to the way. A frame that measures nothing adds what a camera gets in the time to the drift, nothing to the way.
TEST(Odometry, GathersDriftByState) {
    Parameters p;
    const SE3 from = se3_exp((Vector6() << 1, 2, 3, 0.3, -0.1, 0.2).finished());
    SE3 step;
    step.rotation = so3_exp(Vector3(0, 0.3, 0.4));  // half a radian
    step.translation = Vector3(0.06, 0, 0.08);      // a tenth of a metre
    const MotionModel motion = moved(from, from * step);
    for (const double share : {0.0, 0.05, 0.5}) {
        for (const double lost_m_s : {0.0, 1.5, 4.0}) {
            p.loop.drift_share = share;
            p.recovery.reach_m_s = lost_m_s;
            const auto gathered = [&](PoseState state) {
                Odometry odometry;
                odometry.set_drift(2);
                odometry.gather_drift(state, motion, 1'100'000'000, p);
                const bool is_measured = state == PoseState::kTracked || state == PoseState::kUnsure;
                EXPECT_NEAR(odometry.travelled(), is_measured ? 0.6 : 0, 1e-12);
                return odometry.drift_m() - 2;
            };
            EXPECT_NEAR(gathered(PoseState::kTracked), share * 0.1, 1e-12);
            EXPECT_NEAR(gathered(PoseState::kUnsure), 3 * share * 0.1, 1e-12);
            EXPECT_NEAR(gathered(PoseState::kPredicted), lost_m_s * 0.1, 1e-12);
            EXPECT_NEAR(gathered(PoseState::kNone), lost_m_s * 0.1, 1e-12);
        }
    }
}

// Promise: drift and way add up over the frames, and neither depends on where the map lies; reset forgets both, and the
// jumps.
TEST(Odometry, AddsUpAndForgets) {
    Random random(4);
    const Parameters p;
    Odometry odometry;
    SE3 pose;
    double travelled = 0, drift_m = 0;
    for (int i = 0; i < 50; ++i) {
        const Vector3 step_m = test::random_vector(random, 0.1), turn = test::random_vector(random, 0.2);
        SE3 next = pose;
        next.translation += pose.rotation * step_m;
        next.rotation = pose.rotation * so3_exp(turn);
        odometry.gather_drift(PoseState::kTracked, moved(pose, next), 1'100'000'000, p);
        travelled += std::sqrt(step_m.squaredNorm()) + std::sqrt(turn.squaredNorm());
        drift_m += p.loop.drift_share * std::sqrt(step_m.squaredNorm());
        const SE3 correction = test::random_motion(random, 1, 1);
        odometry.jump(correction);
        pose = correction * next;
        EXPECT_NEAR(odometry.travelled(), travelled, 1e-9);
        EXPECT_NEAR(odometry.drift_m(), drift_m, 1e-9);
    }
    odometry.reset();
    EXPECT_EQ(odometry.travelled(), 0);
    EXPECT_EQ(odometry.drift_m(), 0);
    expect_same(Split(odometry, pose).map_from_odom, SE3{}, 1e-15);
}

}  // namespace
}  // namespace stillmesh::odometry_test
