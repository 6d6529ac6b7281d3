// One number over everything geometry computes: seen equal from gcc 12 (-O0, -O2, -O3 with FMA at hand) and clang 14 on
// x86-64, and from gcc on arm64 and armhf. Whoever changes a formula changes the number, and says so in the commit.
#include <gtest/gtest.h>

#include "engine/base/hash.hpp"
#include "engine/base/numbers.hpp"
#include "engine/base/random.hpp"
#include "engine/geometry/camera.hpp"
#include "engine/geometry/depth_noise.hpp"
#include "engine/geometry/se3.hpp"
#include "engine/geometry/trig.hpp"

namespace stillmesh {
namespace {

// Promise: geometry gives the same bits on every processor, compiler and optimisation level.
TEST(Geometry, GoldenBits) {
    Random random(1);  // one draw a statement: arguments have no order of evaluation
    StateHash hash;
    const CameraModel model{640,      480,       517.306408, 516.469215, 318.643040, 255.313989,
                            0.262383, -0.953104, -0.005358,  0.002628,   1.163314};
    for (int i = 0; i < 20'000; ++i) {
        Vector6 xi;
        for (int k = 0; k < 6; ++k) xi[k] = random.uniform(-2, 2);
        SE3 motion = se3_exp(xi);
        const Vector6 twice = se3_log(motion * motion);
        for (int k = 0; k < 6; ++k) hash.add(twice[k]);
        const Vector4 q = quaternion_from_rotation(motion.rotation);
        for (int k = 0; k < 4; ++k) hash.add(q[k]);
        renormalise(motion.rotation);
        hash.add(motion.rotation(1, 2));

        const double u = random.uniform(0, 639);
        const double v = random.uniform(0, 479);
        const Vector2 n = undistort_to_normalised(model, {u, v});
        hash.add(n.x());
        hash.add(n.y());
        hash.add(round_clamped(random.uniform(-5e9, 5e9)));
        hash.add(arc_tan2(n.x(), n.y()));
        hash.add(sin_cos(u).sin);
    }
    EXPECT_EQ(hash.value(), 0x2bb277b31d3ae9b2ULL) << std::hex << hash.value();
}

}  // namespace
}  // namespace stillmesh
