#include "engine/tracking/camera_reach.hpp"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <cstdint>

namespace stillmesh::camera_reach_test {
namespace {

constexpr std::int64_t kFrame_ns = 33'333'333;

SE3 at(double x, double turn_rad = 0) {
    Vector6 xi = Vector6::Zero();
    xi(5) = turn_rad;
    SE3 out = se3_exp(xi);
    out.translation = Vector3(x, 0, 0);
    return out;
}

// A camera that was sure in two frames, 1.5 cm apart (0.45 m/s), the second of them at frame 0.
CameraReach moving() {
    MotionModel motion;
    motion.begin_after(-2 * kFrame_ns);
    motion.move_to(at(-0.015));
    motion.end_frame(-kFrame_ns);
    motion.move_to(at(0));
    CameraReach reach;
    reach.note(motion, true, 0);
    return reach;
}

// How far ahead the reach ends after so many frames.
double end_of(const CameraReach& reach, int frames, const Parameters& configuration) {
    double inside = 0, outside = 1000;
    while (outside - inside > 1e-6) {
        const double middle = 0.5 * (inside + outside);
        (reach.holds(at(middle), frames * kFrame_ns, configuration) ? inside : outside) = middle;
    }
    return inside;
}

// Promise: two frames a nanosecond apart, whose turn is a speed that no camera has, end nothing.
TEST(CameraReach, AnySpeedIsBorne) {
    MotionModel motion;
    motion.begin_after(-2);
    motion.move_to(at(0));
    motion.end_frame(-1);
    motion.move_to(at(0, 0.1));
    CameraReach reach;
    reach.note(motion, true, 0);
    EXPECT_TRUE(reach.holds(at(0, 0.1), 0, Parameters{}));
    EXPECT_FALSE(reach.holds(at(100), kFrame_ns, Parameters{}));
}

// Promise: the reach goes on with the camera, opens with the square of the time while it accelerates, and no faster
// than a lost camera gets; what the camera's speed explains costs nothing of it.
TEST(CameraReach, AcceleratesThenGoesAtFullSpeed) {
    const Parameters c;
    const CameraReach reach = moving();
    const double frame_s = 1e-9 * kFrame_ns, speed = 0.015 / frame_s;
    for (const int frames : {1, 2, 4, 8}) {
        const double t = frames * frame_s;
        const double aside = c.recovery.reach_m + 0.5 * c.prediction.acceleration_m_s2 * t * t;
        EXPECT_NEAR(end_of(reach, frames, c), speed * t + aside, 1e-5) << frames;
    }
    const double late = end_of(reach, 60, c), later = end_of(reach, 90, c);
    EXPECT_NEAR(later - late, c.recovery.reach_m_s * 30 * frame_s, 1e-5);
    for (int frames = 1; frames < 100; ++frames) {
        EXPECT_TRUE(reach.holds(at(std::min(frames, 9) * 0.015), frames * kFrame_ns, c)) << frames;
    }
}

// Promise: turning has a reach of its own.
TEST(CameraReach, TurnsNoFasterThanHandsDo) {
    const Parameters c;
    CameraReach reach;
    reach.begin(at(0), 0);
    const double t = 2e-9 * kFrame_ns;
    const double end =
        c.recovery.reach_rad + std::min(c.recovery.reach_rad_s * t, 0.5 * c.prediction.acceleration_rad_s2 * t * t);
    EXPECT_TRUE(reach.holds(at(0, end - 1e-4), 2 * kFrame_ns, c));
    EXPECT_FALSE(reach.holds(at(0, end + 1e-4), 2 * kFrame_ns, c));
    EXPECT_TRUE(reach.holds(at(0, 3), 60 * kFrame_ns, c));
}

// Promise: when the world is corrected under the camera, what was within reach stays so, and what was beyond stays so.
TEST(CameraReach, FollowsTheMap) {
    const Parameters c;
    CameraReach reach = moving();
    const SE3 correction = at(2, 1);
    reach.follow(correction);
    EXPECT_TRUE(reach.holds(correction * at(0.1), kFrame_ns, c));
    EXPECT_FALSE(reach.holds(correction * at(0.2), kFrame_ns, c));
    EXPECT_FALSE(reach.holds(at(0.1), kFrame_ns, c));
}

// Promise: a pose that is no number is beyond every reach.
TEST(CameraReach, NoNumberIsOutOfReach) {
    EXPECT_FALSE(moving().holds(at(std::nan("")), kFrame_ns, Parameters{}));
}

// Promise: every number of the reach is the configuration's: how far at once, how fast, how the camera accelerates, and
// for how long its motion goes on.
TEST(CameraReach, IsConfigured) {
    const double frame_s = 1e-9 * kFrame_ns, speed = 0.015 / frame_s;
    for (const bool is_other : {false, true}) {
        Parameters c;
        if (is_other) {
            c.recovery.reach_m = 0.4;
            c.recovery.reach_m_s = 0.7;
            c.recovery.reach_rad = 0.1;
            c.recovery.reach_rad_s = 0.5;
            c.prediction.acceleration_m_s2 = 2;
            c.prediction.acceleration_rad_s2 = 5;
            c.prediction.goes_on_s = 1;
        }
        const CameraReach reach = moving();
        CameraReach still;
        still.begin(at(0), 0);
        for (const int frames : {1, 3, 10, 20, 60}) {
            const double t = frames * frame_s;
            const double ahead = speed * std::min(t, c.prediction.goes_on_s);
            const double aside =
                c.recovery.reach_m + std::min(c.recovery.reach_m_s * t, 0.5 * c.prediction.acceleration_m_s2 * t * t);
            EXPECT_NEAR(end_of(reach, frames, c), ahead + aside, 1e-5) << frames;
            EXPECT_NEAR(end_of(still, frames, c), aside, 1e-5) << frames;
            const double turn = c.recovery.reach_rad +
                                std::min(c.recovery.reach_rad_s * t, 0.5 * c.prediction.acceleration_rad_s2 * t * t);
            if (turn > 3) continue;
            EXPECT_TRUE(still.holds(at(0, turn - 1e-4), frames * kFrame_ns, c)) << frames;
            EXPECT_FALSE(still.holds(at(0, turn + 1e-4), frames * kFrame_ns, c)) << frames;
        }
    }
}

// Promise: a pose that is sure and tells no velocity, or whose time is that of the frame before, is one at rest.
TEST(CameraReach, WithoutAVelocityItIsAtRest) {
    const Parameters c;
    for (const std::int64_t gap_ns : {kFrame_ns, std::int64_t{0}}) {
        MotionModel motion;
        motion.begin_after(0);
        motion.move_to(at(-0.3));
        motion.end_frame(0);
        motion.move_to(at(0));
        CameraReach reach;
        reach.note(motion, gap_ns == 0, gap_ns);
        CameraReach still;
        still.begin(at(0), gap_ns);
        const auto frames = static_cast<int>(gap_ns / kFrame_ns) + 1;
        EXPECT_NEAR(end_of(reach, frames, c), end_of(still, frames, c), 1e-9);
    }
}

}  // namespace
}  // namespace stillmesh::camera_reach_test
