#include "engine/tracking/tracked_shutter.hpp"

#include <gtest/gtest.h>

#include <cmath>
#include <cstdint>
#include <vector>

#include "tests/support/synthetic.hpp"
#include "tests/tracking/shutter_rig.hpp"

namespace stillmesh::tracked_shutter_test {
namespace {

using test::kPeriod_s;
using test::kReadout_s;

class Shutter : public test::ShutterRig {};

Vector3 moved_by(const Vector6& speed, const Vector3& p) {
    return Vector3(speed(3), speed(4), speed(5)).cross(p) + Vector3(speed(0), speed(1), speed(2));
}

// Promise: the camera's speed is its motion over its duration.
TEST_F(Shutter, SpeedIsTheMotionOverItsTime) {
    Random random(1);
    for (const double duration_s : {0.01, 0.04, 0.5}) {
        Vector6 xi;
        xi.head<3>() = test::random_vector(random, 0.1);
        xi.tail<3>() = test::random_vector(random, 0.2);
        shutter_.set_motion(se3_exp(xi), duration_s);
        EXPECT_LT((shutter_.speed() * duration_s - xi).cwiseAbs().maxCoeff(), 1e-9);
    }
    shutter_.reset();
    EXPECT_EQ(shutter_.speed().cwiseAbs().maxCoeff(), 0);
}

// Promise: a point measured in a row moves with the readout as the camera does, by the row's share of it, and as the
// pose does that saw it; given in the world.
TEST_F(Shutter, PointsMoveWithTheReadout) {
    see(kReadout_s);
    shutter_.set_motion(se3_exp(speed_ * kPeriod_s), kPeriod_s);
    for (const bool has_learnt : {false, true}) {
        if (has_learnt) learn();
        const Vector6 of_pose = shutter_.pose_by_readout();
        EXPECT_EQ(of_pose.cwiseAbs().maxCoeff() > 0.01, has_learnt);
        for (const double y : {0.0, 30.0, 60.0, 119.0}) {
            const Vector3 p(0.3, -0.2, 2.0);
            const Vector3 expected = pose_.rotation * (moved_by(speed_, p) * (y / 120 - 0.5) + moved_by(of_pose, p));
            EXPECT_LT((shutter_.by_readout(pose_, p, static_cast<float>(y)) - expected).cwiseAbs().maxCoeff(), 1e-9);
        }
    }
}

// Promise: frames whose rows were read one by one tell the readout; once it is adopted the map and the camera are where
// they would be had it been known all along: points by their derivative, the last two poses each by its own.
TEST_F(Shutter, WhatIsLearntIsAdopted) {
    see(kReadout_s);
    Random random(2);
    for (const Handle<MapPoint> point : points_) {  // how they move is known: not at all, or as they like
        store(Vector3(0, 0, 0), (*world_)[point].world_by_readout);
        store(test::random_vector(random, 1), (*world_)[point].anchor_by_readout);
    }
    const Handle<MapPoint> other = world_->add_point(Vector3(5, 5, 5));
    store(Vector3(1, -2, 3), (*world_)[other].world_by_readout);
    const Handle<Keyframe> keyframe = world_->add_keyframe(pose_, 3);
    (*world_)[keyframe].pose_by_readout << 1, 2, -1, 0.5, 0.2, -0.4;
    const Vector6 of_keyframe = (*world_)[keyframe].pose_by_readout;
    MotionModel motion;
    motion.move_to(SE3{});
    motion.move_to(pose_);
    learn();
    const Vector6 of_previous = shutter_.pose_by_readout();
    speed_ *= 1.1;  // so that two frames differ
    learn();
    speed_ *= 1 / 1.1;
    for (int frame = 0; frame < 100; ++frame) learn();
    speed_ *= 1.1;
    learn();
    speed_ *= 1 / 1.1;
    learn();
    const Vector6 of_last = shutter_.pose_by_readout();
    EXPECT_EQ(shutter_.readout_s(), 0) << "until it is adopted";
    EXPECT_EQ(world_->map().readout_s(), 0);
    shutter_.adopt(world_->map(), motion);
    const double readout_s = shutter_.readout_s();
    EXPECT_NEAR(readout_s, kReadout_s, 0.1 * kReadout_s);
    EXPECT_EQ(world_->map().readout_s(), readout_s);
    EXPECT_LT((vector_of((*world_)[other].world) - (Vector3(5, 5, 5) + Vector3(1, -2, 3) * readout_s)).norm(), 1e-6);
    EXPECT_LT(test::metres_between((*world_)[keyframe].world_from_camera, pose_ * se3_exp(of_keyframe * readout_s)),
              1e-12);
    EXPECT_LT(test::metres_between(motion.world_from_camera(), pose_ * se3_exp(of_last * readout_s)), 1e-12);
    const double previous_m = test::metres_between(motion.world_from_camera_previous(), SE3{});
    EXPECT_GT(previous_m, 1e-4);
    EXPECT_NEAR(previous_m, std::sqrt(se3_exp(of_previous * (1.1 * readout_s)).translation.squaredNorm()),
                1e-3 * previous_m);
    // What is within step_s of what is believed changes nothing.
    const SE3 before = motion.world_from_camera();
    shutter_.adopt(world_->map(), motion);
    EXPECT_EQ(shutter_.readout_s(), readout_s);
    EXPECT_EQ(test::metres_between(motion.world_from_camera(), before), 0);
    shutter_.reset();
    EXPECT_EQ(shutter_.readout_s(), 0);
    EXPECT_EQ(shutter_.pose_by_readout().cwiseAbs().maxCoeff(), 0);
}

// Promise: frames that do not count say how their pose moves, and teach nothing.
TEST_F(Shutter, WhatDoesNotCountTeachesNothing) {
    see(kReadout_s);
    MotionModel motion;
    for (int frame = 0; frame < 50; ++frame) learn(false);
    EXPECT_GT(shutter_.pose_by_readout().cwiseAbs().maxCoeff(), 0.01);
    shutter_.adopt(world_->map(), motion);
    EXPECT_EQ(shutter_.readout_s(), 0);
    EXPECT_EQ(world_->map().readout_s(), 0);
}

// Promise: only the points that stand still are asked, and only those that the pose explains.
TEST_F(Shutter, OnlyTheChosenTeach) {
    see(0);
    const auto learnt = [&](const std::vector<std::uint16_t>& chosen, double chi2_max) {
        shutter_.reset();
        MotionModel motion;
        shutter_.set_motion(se3_exp(speed_ * kPeriod_s), kPeriod_s);
        for (int frame = 0; frame < 50; ++frame) {
            shutter_.learn(frame_->measured, world_->map(), correspondences_, chosen, pose_, chi2_max, true);
        }
        test::SmallWorld nothing;
        shutter_.adopt(nothing.map(), motion);
        return shutter_.readout_s();
    };
    std::vector<std::uint16_t> still;
    for (std::uint16_t i = 0; i < correspondences_.size(); ++i) {
        if (i % 2 == 0) {
            still.push_back(i);
        } else {  // moves as a readout of -20 ms would make it
            const Keypoint& k = frame_->measured.keypoint(i);
            const double z_m = correspondences_[i].p_camera.z();
            correspondences_[i].p_world =
                pose_ * in_middle_row(static_cast<double>(k.x), static_cast<double>(k.y), z_m, -kReadout_s);
        }
    }
    EXPECT_EQ(learnt(still, 1e6), 0);
    EXPECT_LT(learnt(test::all_of(correspondences_), 1e6), -0.005);
    EXPECT_EQ(learnt(test::all_of(correspondences_), 0.5), 0) << "what does not agree is left out";
}

// Promise: a readout that is given is kept, and so is the map's expression with it.
TEST_F(Shutter, AGivenReadoutIsKept) {
    Parameters parameters = test::small_parameters();
    parameters.camera.readout_s = 0.01;
    start(parameters);
    see(kReadout_s);
    MotionModel motion;
    for (int frame = 0; frame < 50; ++frame) learn();
    EXPECT_EQ(shutter_.pose_by_readout().cwiseAbs().maxCoeff(), 0);
    shutter_.adopt(world_->map(), motion);
    EXPECT_EQ(shutter_.readout_s(), 0.01);
}

// Promise: in a map that was loaded an estimated readout goes on with the map's; a given one expresses the map anew.
TEST_F(Shutter, GoesOnWithAMapOrExpressesIt) {
    for (const bool is_given : {false, true}) {
        Parameters parameters = test::small_parameters();
        if (is_given) parameters.camera.readout_s = 0.03;
        start(parameters);
        world_->map().begin_with_readout(0.018);
        const Handle<MapPoint> point = world_->add_point(Vector3(1, 2, 3));
        store(Vector3(10, 20, -30), (*world_)[point].world_by_readout);
        shutter_.begin_in(world_->map());
        EXPECT_EQ(shutter_.readout_s(), is_given ? 0.03 : 0.018);
        EXPECT_EQ(world_->map().readout_s(), shutter_.readout_s());
        const Vector3 expected = Vector3(1, 2, 3) + Vector3(10, 20, -30) * (is_given ? 0.012 : 0.0);
        EXPECT_LT((vector_of((*world_)[point].world) - expected).norm(), 1e-6);
    }
}

// Promise: how fast the camera was in the first frame, which shows in the second, is told to the only keyframe and to
// the points that were made with it; not to other points, nor to a keyframe of another time.
TEST_F(Shutter, TheFirstKeyframeLearnsItsSpeedLater) {
    Parameters parameters = test::small_parameters();
    parameters.camera.readout_s = kReadout_s;
    start(parameters);
    shutter_.backdate(world_->map(), 0);  // without a keyframe there is nothing to tell
    const Handle<Keyframe> first = world_->add_keyframe(pose_, 0);
    (*world_)[first].time_ns = 77;
    const double rows[] = {10, 100};
    for (int n = 0; n < 3; ++n) {
        const Handle<MapPoint> point = world_->add_point(pose_ * test::point_at_pixel(50, rows[n % 2], 2));
        (*world_)[point].created_ns = n < 2 ? 77 : 78;
        points_.push_back(point);
        Observation seen;
        seen.point = point;
        seen.y = static_cast<float>(rows[n % 2]);
        world_->map().add_observation(first, seen);
    }
    world_->map().add_observation(first, {});  // shows nothing
    shutter_.set_motion(se3_exp(speed_ * kPeriod_s), kPeriod_s);
    shutter_.backdate(world_->map(), 76);
    EXPECT_EQ((*world_)[first].readout_s, 0);
    EXPECT_EQ((*world_)[first].speed.cwiseAbs().maxCoeff(), 0);
    EXPECT_EQ(vector_of((*world_)[points_[0]].world_by_readout).norm(), 0);
    shutter_.backdate(world_->map(), 77);
    EXPECT_EQ((*world_)[first].readout_s, kReadout_s);
    EXPECT_LT(((*world_)[first].speed - speed_).cwiseAbs().maxCoeff(), 1e-9);
    for (std::size_t n = 0; n < 3; ++n) {
        const Vector3 p = test::point_at_pixel(50, rows[n % 2], 2);
        Vector3 expected = pose_.rotation * (moved_by(speed_, p) * (rows[n % 2] / 120 - 0.5));
        if (n == 2) expected = Vector3(0, 0, 0);
        const MapPoint& point = (*world_)[points_[n]];
        EXPECT_LT((vector_of(point.world_by_readout) - expected).norm(), 1e-6);
        EXPECT_LT((vector_of(point.anchor_by_readout) - expected).norm(), 1e-6);
    }
}

}  // namespace
}  // namespace stillmesh::tracked_shutter_test
