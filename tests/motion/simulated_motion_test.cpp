#include "platform/motion/simulated_motion.hpp"

#include <gtest/gtest.h>

#include <cmath>

namespace stillmesh::simulated_motion_test {
namespace {

constexpr std::int64_t kGap_ns = 33'333'333;

// On a straight way of 1 cm a frame, turning by .01 rad a frame.
TrajectoryPose pose(int i) {
    return {i * kGap_ns, {0, 0, 0.01 * i}, quaternion_of({0, 0.01 * i, 0})};
}

// Promise: wheels are off by the share that is claimed, on the whole of the way, and a gyroscope by its bias; with an
// excess, by so many times as much while the claim stays.
TEST(SimulatedMotion, ErrorsAreWhatIsClaimed) {
    for (const double excess : {1.0, 5.0}) {
        SimulatedMotion motion(4, {}, excess);
        EXPECT_FALSE(motion.step(pose(0)));
        double way_m = 0, turn_rad = 0, claimed_m = 0;
        Triple rate{};
        for (int i = 1; i <= 300; ++i) {
            ASSERT_TRUE(motion.step(pose(i)));
            const RigidTransform& step = motion.wheels().last_from_camera;
            // The camera looks along z and has turned meanwhile: the way is that along both.
            const Triple t = {step.translation_m[0], step.translation_m[1], step.translation_m[2]};
            const RigidTransform truth = step_between(pose(i - 1), pose(i));
            way_m += (t[0] * truth.translation_m[0] + t[2] * truth.translation_m[2]) / 0.01;
            const double* const q = step.rotation_xyzw;
            turn_rad += rotation_vector_of({q[0], q[1], q[2], q[3]})[1];
            claimed_m = motion.wheels().sigma_m;
            for (std::size_t k = 0; k < 3; ++k) rate[k] += motion.gyroscope_rad_s()[k] / 300;
        }
        EXPECT_NEAR(std::abs(way_m - 3), excess * 0.06, excess * 0.016);  // 3 sigma of 300 steps' noise
        EXPECT_NEAR(std::abs(turn_rad - 3), excess * 0.06, excess * 0.016);
        EXPECT_NEAR(claimed_m, 0.0002 + 0.0003, 1e-9);
        rate[1] -= 0.01 / (kGap_ns * 1e-9);
        EXPECT_NEAR(length_of(rate), excess * 0.0087266463, excess * 0.0003);
        EXPECT_LT(motion.gyroscope().sigma_m, 0);
        EXPECT_NEAR(motion.gyroscope().sigma_rad, (0.0087266463 + 0.00087) * kGap_ns * 1e-9, 1e-9);
    }
}

// Promise: the same seed gives the same errors, another one others.
TEST(SimulatedMotion, ErrorsAreOfASeed) {
    const auto first_step = [](std::uint64_t seed) {
        SimulatedMotion motion(seed);
        static_cast<void>(motion.step(pose(0)));
        static_cast<void>(motion.step(pose(1)));
        return motion.wheels().last_from_camera.translation_m[2];
    };
    EXPECT_EQ(first_step(1), first_step(1));
    EXPECT_NE(first_step(1), first_step(2));
}

}  // namespace
}  // namespace stillmesh::simulated_motion_test
