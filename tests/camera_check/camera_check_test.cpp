#include "platform/camera_check/camera_check.hpp"

#include <gtest/gtest.h>

#include <algorithm>

#include "tests/engine/engine_rig.hpp"
#include "tests/support/frames.hpp"

namespace stillmesh::camera_check_test {
namespace {

// Not the limits of a test: at 640x480 with a room's features, as a camera is checked.
class LookingAround : public testing::Test {
protected:
    static constexpr std::uint32_t kFrames = 70;
    static const test::Sequence& sequence() {
        static const test::Sequence made = test::rendered("static_rpy", kFrames, 640, 480, 3);
        return made;
    }
    struct Outcome {
        std::vector<std::string> faults;
        std::uint32_t held_from = kFrames;  // first frame after which it holds
        bool holds = false;
    };
    // `depth_from`: from frame `begin` on, depth is that of so many frames later.
    static Outcome check(const CameraModel& given, double factor, std::uint32_t begin = kFrames,
                         std::uint32_t later = 0) {
        CameraInfo info;
        info.model = given;
        info.depth_units_per_m = 5000 / factor;
        const test::EngineRig engine(Limits::room(), given);
        CameraCheck check(info);
        Outcome out;
        for (std::uint32_t i = 0; i + later < kFrames; ++i) {
            Frame frame = sequence().frames[i].frame();
            if (i >= begin) frame.depth = sequence().frames[i + later].frame().depth;
            frame.depth_units_per_m = info.depth_units_per_m;
            EXPECT_EQ(engine->submit(frame), Status::kOk);
            check.frame(frame, engine->features());
            if (check.holds()) out.held_from = std::min(out.held_from, i);
        }
        out.faults = check.faults();
        out.holds = check.holds();
        return out;
    }
    static bool says(const Outcome& outcome, const char* text) {
        return std::any_of(outcome.faults.begin(), outcome.faults.end(),
                           [&](const std::string& fault) { return fault.find(text) != std::string::npos; });
    }
};

// Promise: with the calibration that the frames were made with, nothing is ever said.
TEST_F(LookingAround, RightIsRight) {
    const Outcome outcome = check(sequence().camera, 1);
    EXPECT_TRUE(outcome.faults.empty()) << outcome.faults.front();
    EXPECT_EQ(outcome.held_from, kFrames);
}

// Promise: half the focal length and half the centre, as of a picture half as large, are named with what would fit.
TEST_F(LookingAround, HalvedIntrinsics) {
    CameraModel given = sequence().camera;
    given.fx *= 0.5;
    given.fy *= 0.5;
    const Outcome outcome = check(given, 1);
    EXPECT_TRUE(outcome.holds);
    EXPECT_TRUE(says(outcome, "fx is 264 px")) << outcome.faults.size();
    EXPECT_TRUE(says(outcome, "fy is 264 px")) << outcome.faults.size();
}

// Promise: a wrong depth unit is known by the first frames, with its factor.
TEST_F(LookingAround, WrongDepthUnit) {
    const Outcome outcome = check(sequence().camera, 5);
    EXPECT_TRUE(outcome.holds);
    EXPECT_LE(outcome.held_from, 10U);
    EXPECT_TRUE(says(outcome, "times too large")) << outcome.faults.size();
    EXPECT_TRUE(says(check(sequence().camera, 0.5), "times too small"));
}

// Promise: depth of a second later is noticed while the camera moves.
TEST_F(LookingAround, DepthOfAnotherMoment) {
    const Outcome outcome = check(sequence().camera, 1, 5, 30);
    EXPECT_TRUE(says(outcome, "does not belong to colour")) << outcome.faults.size();
}

// Promise: while the camera moves, also when the lens has long been known, and most frames are looked at only in
// passing: within five frames, and not before it is so.
TEST_F(LookingAround, DepthOfAnotherMomentLater) {
    constexpr std::uint32_t kRight = 4 * kFrames + 20, kLater = 30;
    CameraInfo info;
    info.model = sequence().camera;
    info.depth_units_per_m = 5000;
    const test::EngineRig engine(Limits::room(), info.model);
    CameraCheck check(info);
    std::uint32_t noticed = 0;
    for (std::uint32_t i = 0; noticed == 0 && i < kRight + 20; ++i) {
        const std::uint32_t there = i % (2 * kFrames);  // there and back
        const std::uint32_t at = std::min(there, 2 * kFrames - 1 - there);
        Frame frame = sequence().frames[at].frame();
        frame.time_ns = 33'000'000LL * (i + 1);
        if (i >= kRight) frame.depth = sequence().frames[(at + kLater) % kFrames].frame().depth;
        ASSERT_EQ(engine->submit(frame), Status::kOk);
        check.frame(frame, engine->features());
        if (check.holds()) noticed = i;
    }
    EXPECT_GE(noticed, kRight);
    EXPECT_LT(noticed, kRight + 5);
}

// Promise: the calibration that would fit is given with what is wrong put right and nothing else changed.
TEST_F(LookingAround, WhatWouldFit) {
    CameraInfo info;
    info.model = sequence().camera;
    info.model.fx *= 1.4;
    info.model.fy *= 1.4;
    info.depth_units_per_m = 1000;
    const test::EngineRig engine(Limits::room(), info.model);
    CameraCheck check(info);
    EXPECT_FALSE(check.corrected().has_value());
    for (std::uint32_t i = 0; i < kFrames; ++i) {
        Frame frame = sequence().frames[i].frame();
        frame.depth_units_per_m = info.depth_units_per_m;
        ASSERT_EQ(engine->submit(frame), Status::kOk);
        check.frame(frame, engine->features());
    }
    ASSERT_TRUE(check.corrected().has_value());
    const CameraInfo right = *check.corrected();
    EXPECT_NEAR(right.model.fx / sequence().camera.fx, 1, 0.05);
    EXPECT_NEAR(right.model.fy / sequence().camera.fy, 1, 0.05);
    EXPECT_NEAR(right.model.cx, sequence().camera.cx, 15);
    EXPECT_EQ(right.depth_units_per_m, 5000);
    EXPECT_EQ(right.model.k1, info.model.k1);
}

}  // namespace
}  // namespace stillmesh::camera_check_test
