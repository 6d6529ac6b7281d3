#include "platform/motion/motion_steps.hpp"

#include <gtest/gtest.h>

#include <cmath>

#include "engine/base/random.hpp"

namespace stillmesh::motion_steps_test {
namespace {

Triple random_triple(Random& random, double size) {
    return {random.uniform(-size, size), random.uniform(-size, size), random.uniform(-size, size)};
}

// Promise: a rotation vector comes back from its quaternion, as short as it may be and up to half a turn; a quaternion
// and its negative are one rotation.
TEST(MotionSteps, RotationVectorsComeBack) {
    Random random(3);
    for (const double size : {1e-12, 1e-6, 0.01, 1.7}) {
        for (int i = 0; i < 50; ++i) {
            const Triple v = random_triple(random, size);
            const Quaternion q = quaternion_of(v);
            for (const double sign : {1.0, -1.0}) {
                const Triple back = rotation_vector_of({sign * q[0], sign * q[1], sign * q[2], sign * q[3]});
                for (std::size_t k = 0; k < 3; ++k) EXPECT_NEAR(back[k], v[k], 1e-9 * size + 1e-20);
            }
        }
    }
}

// Promise: a quarter turn about z takes x to y.
TEST(MotionSteps, RotationsTurnTheRightWay) {
    const Triple y = rotated(quaternion_of({0, 0, std::acos(-1.0) / 2}), {1, 0, 0});
    EXPECT_NEAR(y[0], 0, 1e-12);
    EXPECT_NEAR(y[1], 1, 1e-12);
    EXPECT_NEAR(y[2], 0, 1e-12);
}

// Promise: a pose moved by the step between two poses is the second one, and halfway twice is the whole way.
TEST(MotionSteps, StepsAddUp) {
    Random random(5);
    for (int i = 0; i < 100; ++i) {
        const TrajectoryPose a{100, random_triple(random, 3), quaternion_of(random_triple(random, 1.5))};
        const TrajectoryPose b{300, random_triple(random, 3), quaternion_of(random_triple(random, 1.5))};
        const TrajectoryPose again = moved_by(a, step_between(a, b), 300);
        const TrajectoryPose middle = between(a, b, 0.5);
        EXPECT_EQ(middle.time_ns, 200);
        const Triple off = rotation_vector_of(product(conjugate(b.q), again.q));
        EXPECT_LT(length_of(off), 1e-12);
        const Triple first = rotation_vector_of(product(conjugate(a.q), middle.q));
        const Triple second = rotation_vector_of(product(conjugate(middle.q), b.q));
        for (std::size_t k = 0; k < 3; ++k) {
            EXPECT_NEAR(again.t[k], b.t[k], 1e-12);
            EXPECT_NEAR(middle.t[k], (a.t[k] + b.t[k]) / 2, 1e-12);
            EXPECT_NEAR(first[k], second[k], 1e-9);
        }
    }
}

}  // namespace
}  // namespace stillmesh::motion_steps_test
