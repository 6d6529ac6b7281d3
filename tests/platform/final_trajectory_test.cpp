#include "platform/evaluation/final_trajectory.hpp"

#include <gtest/gtest.h>

#include <array>
#include <cstdint>
#include <cstdlib>

namespace stillmesh::final_trajectory_test {
namespace {

TrajectoryPose pose(std::int64_t time_ns, double x, double y = 0) {
    return {time_ns, {x, y, 0.5}, {0, 0, 0, 1}};
}

// Promise: poses that strayed lie on the line between their neighbours at the end, by their times, and turn as they
// were given out; all others are as they were.
TEST(FinalTrajectory, WhatStrayedLiesOnTheLine) {
    FinalTrajectory path;
    const std::array<std::int64_t, 7> times = {0, 10, 15, 30, 50, 60, 75};
    for (const std::int64_t t : times) {
        TrajectoryPose given = pose(t, 0.01 * static_cast<double>(t), t > 10 && t < 50 ? 0.3 : 0.0);
        given.q = {0, 0, 0.6, 0.8};
        path.add(given, KeyframeNow::kNone);
        if (t == 50) path.straighten(10);
    }
    const Trajectory out = path.finish();
    ASSERT_EQ(out.size(), times.size());
    for (std::size_t i = 0; i < out.size(); ++i) {
        EXPECT_EQ(out[i].time_ns, times[i]);
        EXPECT_NEAR(out[i].t[0], 0.01 * static_cast<double>(times[i]), 1e-12);
        EXPECT_NEAR(out[i].t[1], 0, 1e-12);
        EXPECT_EQ(out[i].q[2], 0.6);
    }
}

// Promise: the line is that between its neighbours as they lie at the end, each with its own keyframe.
TEST(FinalTrajectory, TheLineFollowsTheKeyframes) {
    FinalTrajectory path;
    std::array<KeyframeNow, 2> keyframes = {KeyframeNow{1, KeyframeNow::kNone, pose(0, 0)},
                                            KeyframeNow{2, 1, pose(0, 0)}};
    path.update(keyframes);
    path.add(pose(0, 0), 1);
    path.add(pose(1, 5), 1);
    path.add(pose(2, 5), 2);
    path.add(pose(4, 4), 2);
    path.straighten(0);
    keyframes[1].pose = pose(0, 0, 8);  // a loop was closed
    path.update(keyframes);
    const Trajectory out = path.finish();
    for (const std::size_t i : {1U, 2U, 3U}) {
        const auto t = static_cast<double>(out[i].time_ns);
        EXPECT_NEAR(out[i].t[0], t, 1e-12);
        EXPECT_NEAR(out[i].t[1], 2 * t, 1e-12);
    }
}

// Promise: where there is no neighbour before or behind them poses stay as they were given out, and a time that no
// frame is behind asks for nothing.
TEST(FinalTrajectory, WithoutNeighboursNothingIsStraightened) {
    FinalTrajectory path;
    path.straighten(-1);
    EXPECT_TRUE(path.finish().empty());
    for (int i = 0; i < 4; ++i) path.add(pose(i, i * i), KeyframeNow::kNone);
    path.straighten(3);
    path.straighten(7);
    for (std::size_t i = 0; i < 4; ++i) EXPECT_EQ(path.finish()[i].t[0], static_cast<double>(i * i));
    path.straighten(1);  // the third alone
    EXPECT_EQ(path.finish()[1].t[0], 1);
    EXPECT_EQ(path.finish()[2].t[0], 5);
    EXPECT_EQ(path.finish()[3].t[0], 9);
}

}  // namespace
}  // namespace stillmesh::final_trajectory_test
