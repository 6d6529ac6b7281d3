// A body's frames and covariances against 4x4 matrices and differences of Eigen's.
#include "platform/poses/body_frames.hpp"

#include <gtest/gtest.h>

#include <cmath>
#include <limits>

#include "tests/support/body_oracle.hpp"

namespace stillmesh::body_frames_test {
namespace {

using test::BodyOracle;

// Promise: what the camera sees ahead, right and below lies ahead, right and below of base_link, wherever it is
// mounted.
TEST(BodyFrames, AxesAreTheBodys) {
    const BodyFrames frames;
    const double ahead[3] = {0, 0, 2}, right[3] = {1, 0, 0}, below[3] = {0, 1, 0};
    EXPECT_EQ(frames.point(ahead), (std::array<double, 3>{2, 0, 0}));
    EXPECT_EQ(frames.point(right), (std::array<double, 3>{0, -1, 0}));
    EXPECT_EQ(frames.point(below), (std::array<double, 3>{0, 0, -1}));
    // Mounted 30 cm up, looking back (half a turn about z).
    const BodyFrames mounted(RigidTransform{{0, 0, 1, 0}, {0, 0, 0.3}});
    const std::array<double, 3> behind = mounted.point(ahead);
    EXPECT_NEAR(behind[0], -2, 1e-12);
    EXPECT_NEAR(behind[1], 0, 1e-12);
    EXPECT_NEAR(behind[2], 0.3, 1e-12);
}

// Promise: poses, covariances and velocities are those that matrices give: B T B^-1, and J C J^T with J by differences.
TEST(BodyFrames, AsMatricesGive) {
    for (const std::uint64_t seed : {1U, 2U, 3U, 4U, 5U}) {
        BodyOracle oracle(seed);
        const RigidTransform mount = oracle.random_pose();
        const RigidTransform pose = oracle.random_pose();
        const RigidTransform map_from_odom = oracle.random_pose();
        oracle.set_mount(mount);
        const BodyFrames frames(mount);
        EXPECT_LT(BodyOracle::distance(frames.of_base(pose), oracle.of_base(pose)), 1e-12);

        double of_camera[36];
        oracle.random_covariance(of_camera);
        const RigidTransform odom_from_base = frames.of_base(pose);
        const RigidTransform map_from_base = compose(frames.of_base(map_from_odom), odom_from_base);
        const Covariance6 in_base = frames.of_base(of_camera);
        EXPECT_LT(BodyOracle::difference(in_parent(in_base, odom_from_base), oracle.in_parent(of_camera, pose)), 1e-5);
        const RigidTransform map_from_camera = compose(map_from_odom, pose);
        EXPECT_LT(
            BodyOracle::difference(in_parent(in_base, map_from_base), oracle.in_parent(of_camera, map_from_camera)),
            1e-5);
        EXPECT_LT(BodyOracle::difference(in_base, oracle.in_child(of_camera, pose)), 1e-5);

        // Ten milliseconds on.
        const RigidTransform next = compose(pose, oracle.small_motion(0.002));
        const Velocity velocity = frames.of_base(velocity_between(pose, next, 0.01));
        EXPECT_LT(oracle.velocity_error(velocity, pose, next, 0.01), 1e-2);
    }
}

// Promise: tracked is as the engine measured it, unsure and predicted are said to be worse, the longer the more; what
// is not known is said to be so, without a number that is none.
TEST(BodyFrames, DoubtIsSaid) {
    Covariance6 measured{};
    for (std::size_t i = 0; i < 6; ++i) measured[7 * i] = 1e-6;
    measured[1] = measured[6] = 5e-7;
    EXPECT_EQ(with_doubt(measured, PoseState::kTracked, 0), measured);
    const Covariance6 unsure = with_doubt(measured, PoseState::kUnsure, 0);
    const Covariance6 soon = with_doubt(measured, PoseState::kPredicted, 0.1);
    const Covariance6 later = with_doubt(measured, PoseState::kPredicted, 2);
    for (std::size_t i = 0; i < 36; ++i) {
        if (i % 7 != 0) {
            EXPECT_EQ(unsure[i], measured[i]);
            continue;
        }
        EXPECT_NEAR(unsure[i], 1e-6 + 0.01, 1e-12);
        EXPECT_NEAR(soon[i], 1e-6 + 0.15 * 0.15, 1e-12);
        EXPECT_NEAR(later[i], 1e-6 + 1.1 * 1.1, 1e-12);
    }
    double of_camera[36] = {};
    of_camera[14] = std::numeric_limits<double>::infinity();
    const Covariance6 unknown = BodyFrames().of_base(of_camera);
    for (std::size_t i = 0; i < 36; ++i) EXPECT_EQ(unknown[i], i % 7 == 0 ? kUnknownVariance : 0) << i;
}

// Promise: where the camera is on the robot is read as it is written, and nothing else is taken for it.
TEST(BodyFrames, PosesAreRead) {
    RigidTransform pose;
    ASSERT_TRUE(parse_pose("0.1,-2,3e-1", pose));
    EXPECT_EQ(pose.translation_m[1], -2);
    EXPECT_EQ(pose.translation_m[2], 0.3);
    EXPECT_EQ(pose.rotation_xyzw[3], 1);
    ASSERT_TRUE(parse_pose("1,2,3,0,0,2,0", pose));
    EXPECT_EQ(pose.rotation_xyzw[2], 1);
    for (const char* const wrong : {"", "1", "1,2", "1,2,", "1,2,3,4", "1,2,3,0,0,0,0", "1,2,nan", "a,b,c",
                                    "1,2,3,0,0,0,1,", "1,2,3,0,0,0,1,1", "1;2;3", "1,2,inf", " 1,2,3"}) {
        EXPECT_FALSE(parse_pose(wrong, pose)) << wrong;
    }
}

}  // namespace
}  // namespace stillmesh::body_frames_test
