#include "platform/grid/grid_job.hpp"

#include <gtest/gtest.h>

#include <array>
#include <cmath>
#include <random>

namespace stillmesh::grid_job_test {
namespace {

// Promise: a level frame that is aligned with another has its heights as before, the other's origin above or below its
// own, and the other's x straight ahead; one that stands on end has at least its origin there.
TEST(GridJob, AlignsWithAnotherFrame) {
    std::mt19937_64 random(3);
    std::normal_distribution<double> normal;
    const auto any_pose = [&] {
        RigidTransform pose{{normal(random), normal(random), normal(random), normal(random)},
                            {normal(random), normal(random), normal(random)}};
        double length = 0;
        for (const double q : pose.rotation_xyzw) length += q * q;
        for (double& q : pose.rotation_xyzw) q /= std::sqrt(length);
        return pose;
    };
    for (int trial = 0; trial < 200; ++trial) {
        const RigidTransform level = any_pose(), frame = any_pose();
        const RigidTransform aligned = aligned_level(level, frame);
        const RigidTransform aligned_from_frame = compose(aligned, inverse_of(frame));
        EXPECT_NEAR(aligned_from_frame.translation_m[0], 0, 1e-9);
        EXPECT_NEAR(aligned_from_frame.translation_m[1], 0, 1e-9);
        const std::array<double, 3> x = rotated(aligned_from_frame, {1, 0, 0});
        EXPECT_NEAR(x[1], 0, 1e-9);
        EXPECT_GE(x[0], 0);
        const std::array<double, 3> p = {normal(random), normal(random), normal(random)};
        EXPECT_NEAR(transformed(aligned, p)[2], transformed(level, p)[2], 1e-9);
    }
    const RigidTransform on_end{{0, std::sqrt(0.5), 0, std::sqrt(0.5)}, {1, 2, 3}};
    const RigidTransform aligned = aligned_level({}, on_end);
    EXPECT_NEAR(compose(aligned, inverse_of(on_end)).translation_m[0], 0, 1e-9);
    EXPECT_TRUE(std::isfinite(aligned.rotation_xyzw[2]));
}

}  // namespace
}  // namespace stillmesh::grid_job_test
