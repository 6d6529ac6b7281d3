#include "engine/tracking/lost_camera.hpp"

#include <gtest/gtest.h>

#include <algorithm>
#include <cstdint>
#include <cstdio>

#include "engine/engine_state.hpp"
#include "tests/engine/lost_rig.hpp"

namespace stillmesh::lost_camera_test {
namespace {

using test::home;
using test::Lost;

// A camera without a vocabulary that has seen nothing for twelve frames: too long for its motion to foretell where it
// is, and too short to be given up. A quarter of the matches with a keyframe is enough to propose a place.
Parameters easily_proposed() {
    Parameters out = test::lost_parameters();
    out.recovery.inlier_share_min = 0.2;
    return out;
}
constexpr int kDarkFrames = 12;

Parameters& parameters_of(Lost& lost) {
    return static_cast<EngineState&>(lost.engine()).world.parameters;
}

// Promise: a place that is proposed and refused, by descriptors or by words, leaves nothing behind: the camera stays
// where it was lost in odometry and in the map, and no pose is given out for the refused place in the frame after. (It
// stood there, .34 m away, and the next frame was `tracked`.)
TEST(LostCamera, ARefusedPlaceLeavesNothingBehind) {
    for (const bool has_vocabulary : {false, true}) {
        for (const bool is_refused : {true, false}) {
            Lost lost(has_vocabulary, 90, has_vocabulary ? test::lost_parameters() : easily_proposed(),
                      has_vocabulary ? 60 : kDarkFrames);
            // Whatever is empty of the map there is too much of it.
            if (is_refused) parameters_of(lost).recovery.empty_share_max = -1;
            const PoseEstimate& dark = lost.in_the_dark();
            std::uint32_t begun = 0;
            for (std::size_t i = 20; i < 40; ++i) {
                lost.show(home().frames[i]);
                const PoseEstimate& pose = lost.engine().pose();
                if (!is_refused) {
                    begun += pose.state == PoseState::kNone ? 1U : 0U;
                    continue;
                }
                EXPECT_LT(pose.state, PoseState::kUnsure) << i;
                EXPECT_LT(test::metres_between(pose.odom_from_camera, dark.odom_from_camera), 1e-3) << i;
                EXPECT_LT(test::metres_between(pose.map_from_odom, dark.map_from_odom), 1e-3) << i;
            }
            EXPECT_EQ(begun > 0, !is_refused) << "a place that is accepted begins a probation";
            const LoopStatistics& loops = lost.engine().statistics().loop;
            EXPECT_EQ(loops.relocalisation_candidates > 0, has_vocabulary);
        }
    }
}

// Promise: a probation whose frames never show enough fails, and the camera is where it was before: the refused place
// is not tried once more as if nothing were known against it, nor carried on from. (It stayed .23 m away.)
TEST(LostCamera, APlaceThatTakesTooLongIsLeft) {
    Parameters configuration = easily_proposed();
    configuration.pose.lost_frames_max = 200;
    Lost lost(false, 90, configuration, kDarkFrames);
    const auto off_m = [&lost] {
        return test::metres_between(lost.engine().pose().odom_from_camera, lost.in_the_dark().odom_from_camera);
    };
    std::uint32_t on_probation = 0, after = 0;
    for (std::size_t i = 30; i < 90; ++i) {
        lost.show(home().frames[i]);
        const PoseState state = lost.engine().pose().state;
        EXPECT_LT(state, PoseState::kUnsure) << i;
        if (state == PoseState::kNone) {
            EXPECT_EQ(after, 0U) << "a second probation at " << i;
            parameters_of(lost).region.score_min = 2;  // from now on no choice is clear
            ++on_probation;
        } else if (on_probation > 0) {
            ++after;
            EXPECT_LT(off_m(), 1e-3) << i;
        }
    }
    EXPECT_EQ(on_probation, 1 + 4 * configuration.recovery.probation_frames) << "and the frame that began it";
    EXPECT_GT(after, 10U);
}

// Promise: what a probation that fails has changed of the camera's state is put back whole, and so is what the local
// map has counted: the camera is measured against the keyframe that it was lost at. (Inlier ratio, frames of the noise,
// doubt and counts stayed those of the place.)
TEST(LostCamera, WhatWasTriedIsPutBackWhole) {
    Lost lost(true);
    const auto camera = [&lost]() -> const CameraState& {
        return static_cast<EngineState&>(lost.engine()).tracking.camera();
    };
    const CameraState before = camera();
    const std::uint64_t reference = lost.engine().reference_keyframe();
    for (std::size_t i = 20; i < 25; ++i) lost.show(home().frames[i]);
    EXPECT_EQ(lost.engine().pose().state, PoseState::kNone);
    EXPECT_EQ(camera().lost_frames, 0U) << "it is on probation";
    EXPECT_NE(camera().inlier_ratio, before.inlier_ratio);
    EXPECT_NE(camera().noise.frames(), before.noise.frames());
    EXPECT_NE(lost.engine().reference_keyframe(), reference);

    test::KeptFrame dark = home().frames[0];
    std::fill(dark.colour.begin(), dark.colour.end(), std::uint8_t{0});
    std::fill(dark.depth.begin(), dark.depth.end(), std::uint16_t{0});
    lost.show(dark);
    const CameraState& after = camera();
    EXPECT_EQ(after.lost_frames, before.lost_frames + 1);
    EXPECT_EQ(after.inlier_ratio, before.inlier_ratio);
    EXPECT_EQ(after.noise.factors().pixel, before.noise.factors().pixel);
    EXPECT_EQ(after.noise.factors().depth, before.noise.factors().depth);
    EXPECT_EQ(after.noise.frames(), before.noise.frames());
    EXPECT_EQ(after.measured_time_ns, before.measured_time_ns);
    EXPECT_EQ(after.start_time_ns, before.start_time_ns);
    EXPECT_EQ(after.odometry.travelled(), before.odometry.travelled());
    EXPECT_EQ(after.world_from_camera().translation, before.world_from_camera().translation);
    // One predicted frame more.
    EXPECT_GT(after.confidence.covariance()(0, 0), before.confidence.covariance()(0, 0));
    EXPECT_LT(after.confidence.covariance()(0, 0), 1.5 * before.confidence.covariance()(0, 0) + 1);
    EXPECT_EQ(lost.engine().reference_keyframe(), reference);
}

}  // namespace
}  // namespace stillmesh::lost_camera_test
