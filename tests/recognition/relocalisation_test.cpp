#include "engine/recognition/relocalisation.hpp"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <cstdint>
#include <cstdio>

#include "tests/engine/lost_rig.hpp"

namespace stillmesh::relocalisation_test {
namespace {

using test::home;
using test::in_the_map;
using test::kHeight;
using test::kWidth;
using test::Lost;
using test::lost_parameters;
using test::metres_between;

// Promise: after two seconds of darkness, in another part of the room, a camera with a vocabulary is back on the map
// within some frames, where it truly is; map_from_odom takes the jump. Without one it stays lost.
TEST(Relocalisation, BackOnTheMapAfterDarkness) {
    for (const std::uint32_t back_at : {20U, 45U}) {
        Lost lost(true);
        std::uint32_t tries = 0;
        std::uint32_t i = back_at;
        for (; i < back_at + 30; ++i) {
            ++tries;
            lost.show(home().frames[i]);
            if (lost.engine().pose().state >= PoseState::kUnsure) break;
        }
        ASSERT_GE(lost.engine().pose().state, PoseState::kUnsure);
        EXPECT_LE(tries, 18U);
        EXPECT_GT(tries, Parameters{}.recovery.probation_frames);
        const double off =
            test::metres_off(in_the_map(lost.engine().pose()), home().frames[0].truth, home().frames[i].truth);
        EXPECT_LT(off, 0.05);
        EXPECT_EQ(lost.engine().statistics().loop.relocalisations, 1U);
        // Odometry goes on from where it was, by what the camera moved in the frames of the probation.
        double moved = 0;
        for (int k = 0; k < 3; ++k) {
            const double d = home().frames[i].truth.t[static_cast<std::size_t>(k)] -
                             home().frames[back_at].truth.t[static_cast<std::size_t>(k)];
            moved += d * d;
        }
        EXPECT_NEAR(metres_between(lost.engine().pose().odom_from_camera, lost.in_the_dark().odom_from_camera),
                    std::sqrt(moved), 0.03);
        std::printf("frame %u: back after %u frames, %.3f m off; in the dark it was thought %.3f m away\n", i, tries,
                    off, metres_between(in_the_map(lost.engine().pose()), in_the_map(lost.in_the_dark())));
        for (std::uint32_t k = 1; k < 10; ++k) {
            lost.show(home().frames[i + k]);
            EXPECT_LT(
                test::metres_off(in_the_map(lost.engine().pose()), home().frames[0].truth, home().frames[i + k].truth),
                0.05);
        }
    }
    Lost lost(false);
    for (std::uint32_t i = 20; i < 50; ++i) lost.show(home().frames[i]);
    EXPECT_EQ(lost.engine().pose().state, PoseState::kNone);
}

// Promise: the map learns nothing from a frame that has not proven where the camera is: where each frame would be a
// keyframe, the one that ends the probation is none yet, and those after it are. A keyframe of its own is what a frame
// looks most alike: it was weighed for the place, and wrong ones of corridors were believed.
TEST(Relocalisation, NoFrameBearsWitnessForItself) {
    Parameters configuration = lost_parameters();
    configuration.keyframes.tracked_urgent_permille = 1000;
    configuration.keyframes.gap_min = 1;
    configuration.keyframes.new_points_min = 1;
    Lost lost(true, 90, configuration);
    const std::uint64_t keyframes = lost.engine().statistics().keyframes_made;
    std::uint32_t i = 20;
    for (; i < 50; ++i) {
        lost.show(home().frames[i]);
        EXPECT_EQ(lost.engine().statistics().keyframes_made, keyframes);
        if (lost.engine().pose().state >= PoseState::kUnsure) break;
    }
    ASSERT_GE(lost.engine().pose().state, PoseState::kUnsure);
    lost.show(home().frames[i + 1]);
    EXPECT_EQ(lost.engine().statistics().keyframes_made, keyframes + 1);
}

// Promise: a camera that was lost for a second is matched with the keyframes around it through the direct index of a
// vocabulary, and is back where it truly is, as it is without one.
TEST(Relocalisation, FoundAgainNearby) {
    for (const bool has_vocabulary : {true, false}) {
        Parameters configuration = lost_parameters();
        configuration.recovery.inlier_share_min = Parameters{}.recovery.inlier_share_min;
        configuration.loop.inliers_min = 4000;  // no place is found anywhere
        Lost lost(has_vocabulary, 90, configuration, 40);
        std::uint32_t i = 90;
        for (; i < 130; ++i) {
            lost.show(home().frames[i]);
            if (lost.engine().pose().state >= PoseState::kUnsure) break;
        }
        ASSERT_GE(lost.engine().pose().state, PoseState::kUnsure);
        EXPECT_EQ(lost.engine().statistics().recoveries, 1U);
        EXPECT_EQ(lost.engine().statistics().loop.relocalisations, 0U);
        EXPECT_EQ(lost.engine().statistics().loop.matched_by_words > 0, has_vocabulary);
        EXPECT_LT(test::metres_off(in_the_map(lost.engine().pose()), home().frames[0].truth, home().frames[i].truth),
                  0.05);
    }
}

// Promise: a frame is matched with a keyframe by words whether or not those of the keyframe are known yet: comparing
// all with all was the dearest thing that a frame could ask for.
TEST(Relocalisation, AKeyframeTooYoungForWordsIsMatchedByWords) {
    Lost lost(true, 10, lost_parameters(), 5);  // 0.33 s: none has words
    const std::uint64_t before = lost.engine().statistics().loop.matched_by_words;
    lost.show(home().frames[60]);
    EXPECT_EQ(lost.engine().statistics().loop.queries, 0U);
    EXPECT_EQ(lost.engine().statistics().loop.matched_by_words, before + 1);
}

// Promise: a lost camera is found by its words only where places are looked for.
TEST(Relocalisation, MayBeSwitchedOff) {
    for (const bool is_relocalising : {true, false}) {
        Parameters configuration = lost_parameters();
        configuration.loop.is_relocalising = is_relocalising;
        Lost lost(true, 90, configuration);
        PoseState best = PoseState::kNone;
        for (std::uint32_t i = 20; i < 50; ++i) {
            lost.show(home().frames[i]);
            best = std::max(best, lost.engine().pose().state);
        }
        EXPECT_EQ(best >= PoseState::kUnsure, is_relocalising);
    }
}

// Promise: a room that is not in the map is not recognised.
TEST(Relocalisation, AnotherRoomIsNotHome) {
    const test::Sequence other = test::rendered("static_halfsphere", 30, kWidth, kHeight, 77);
    Lost lost(true);
    for (const test::KeptFrame& frame : other.frames) {
        lost.show(frame);
        EXPECT_EQ(lost.engine().pose().state, PoseState::kNone);
    }
    EXPECT_EQ(lost.engine().statistics().loop.relocalisations, 0U);
    EXPECT_EQ(lost.engine().statistics().loop.relocalisation_queries, other.frames.size());
}

// Promise: a camera that was found is not believed at once. If the picture then goes dark, no pose was given out, no
// keyframe made and no relocalisation counted, and it is lost where it was lost before; nor does another room finish
// what was begun. Brought home, it is found there.
TEST(Relocalisation, WhatFailsTheProbationIsUndone) {
    const test::Sequence other = test::rendered("static_halfsphere", 20, kWidth, kHeight, 77);
    Lost lost(true);
    const std::uint64_t keyframes = lost.engine().statistics().keyframes_made;
    const std::uint32_t probation = Parameters{}.recovery.probation_frames;
    const auto show_nothing_known = [&](const test::KeptFrame& frame) {
        lost.show(frame);
        EXPECT_EQ(lost.engine().pose().state, PoseState::kNone);
        EXPECT_EQ(lost.engine().statistics().keyframes_made, keyframes);
        EXPECT_EQ(lost.engine().statistics().loop.relocalisations, 0U);
    };
    std::uint32_t matched = 0;
    for (std::uint32_t i = 20; i < 20 + probation; ++i) {
        show_nothing_known(home().frames[i]);
        matched += lost.engine().frame_statistics().static_matches > 0 ? 1U : 0U;
    }
    EXPECT_GT(matched, probation / 2) << "it was on probation";
    test::KeptFrame dark = home().frames[0];
    std::fill(dark.colour.begin(), dark.colour.end(), std::uint8_t{0});
    show_nothing_known(dark);
    EXPECT_EQ(in_the_map(lost.engine().pose()).translation_m[0], in_the_map(lost.in_the_dark()).translation_m[0]);
    for (const test::KeptFrame& frame : other.frames) show_nothing_known(frame);
    std::uint32_t i = 45;
    for (; i < 45 + 30 && lost.engine().pose().state < PoseState::kUnsure; ++i) lost.show(home().frames[i]);
    ASSERT_GE(lost.engine().pose().state, PoseState::kUnsure);
    EXPECT_LT(test::metres_off(in_the_map(lost.engine().pose()), home().frames[0].truth, home().frames[i - 1].truth),
              0.05);
}

}  // namespace
}  // namespace stillmesh::relocalisation_test
