// A run that begins at a known pose, through the front door.
#include <gtest/gtest.h>

#include <cmath>
#include <limits>
#include <vector>

#include "tests/engine/engine_rig.hpp"

namespace stillmesh::start_test {
namespace {

using test::EngineRig;
using test::KeptFrame;
using test::Sequence;

// A quarter turn about z, 2 m aside and 1 m down.
constexpr RigidTransform kStart{{0, 0, 0.70710678118654757, 0.70710678118654757}, {2, 1, 0}};

void expect_near(const RigidTransform& a, const RigidTransform& b, double tolerance) {
    for (std::size_t i = 0; i < 3; ++i) EXPECT_NEAR(a.translation_m[i], b.translation_m[i], tolerance);
    const RotationMatrix of_a = matrix_of(a.rotation_xyzw), of_b = matrix_of(b.rotation_xyzw);
    for (std::size_t i = 0; i < 9; ++i) EXPECT_NEAR(of_a[i], of_b[i], tolerance);
}

// Promise: poses in the map, and the map, count from where the run is said to start; odometry begins there, at nothing,
// and goes as it does without. (Not to the bit: coordinates are others.)
TEST(Start, TheMapCountsFromThere) {
    const Sequence room = test::rendered("static_xyz", 20, 160, 120);
    const EngineRig plain(Limits::tiny(), room.camera), placed(Limits::tiny(), room.camera);
    ASSERT_EQ(placed->start_at(kStart), Status::kOk);
    for (const KeptFrame& kept : room.frames) {
        ASSERT_EQ(plain->submit(kept.frame()), Status::kOk);
        ASSERT_EQ(placed->submit(kept.frame()), Status::kOk);
        EXPECT_EQ(placed->pose().state, plain->pose().state);
        expect_near(placed->pose().odom_from_camera, plain->pose().odom_from_camera, 0.003);
        expect_near(placed->pose().map_from_odom, kStart, 1e-9);
    }
    std::vector<KeyframePose> keyframes(Limits::tiny().keyframes_max);
    ASSERT_GT(placed->keyframes(keyframes), 0U);
    expect_near(keyframes[0].map_from_camera, kStart, 1e-6);
    placed->reset();
    ASSERT_EQ(placed->submit(room.frames[0].frame()), Status::kOk);
    expect_near(placed->pose().map_from_odom, RigidTransform{}, 0);
}

// Promise: what is no pose is refused, and so is any after the first frame; nothing changes then.
TEST(Start, WhatIsNoPoseOrLateIsRefused) {
    const Sequence room = test::rendered("static_xyz", 2, 160, 120);
    const EngineRig engine(Limits::tiny(), room.camera), plain(Limits::tiny(), room.camera);
    RigidTransform wrong = kStart;
    wrong.rotation_xyzw[0] = 0.2;
    EXPECT_EQ(engine->start_at(wrong), Status::kInvalid);
    wrong = kStart;
    wrong.translation_m[1] = std::numeric_limits<double>::quiet_NaN();
    EXPECT_EQ(engine->start_at(wrong), Status::kInvalid);
    wrong.translation_m[1] = -1000;
    EXPECT_EQ(engine->start_at(wrong), Status::kInvalid);
    for (const KeptFrame& kept : room.frames) {
        ASSERT_EQ(engine->submit(kept.frame()), Status::kOk);
        ASSERT_EQ(plain->submit(kept.frame()), Status::kOk);
        EXPECT_EQ(engine->start_at(kStart), Status::kInvalid);
        EXPECT_EQ(engine->state_hash(), plain->state_hash());
    }
}

}  // namespace
}  // namespace stillmesh::start_test
