#include <gtest/gtest.h>

#include <set>
#include <vector>

#include "engine/features/orb_extractor.hpp"
#include "platform/linux/cpu_kernels.hpp"
#include "tests/features/images.hpp"
#include "tests/features/rig.hpp"

namespace stillmesh {
namespace {

using testing::Image;
using testing::Rig;

// Promise: the plan and what is used agree to the byte, for every preset.
TEST(OrbExtractor, plan_equals_use) {
    for (const Limits& limits : {Limits::room(), Limits::pocket(), Limits::tiny()}) {
        const Rig rig(limits, plain_kernels());
        EXPECT_EQ(rig.planned_bytes, rig.used_bytes);
    }
}

// Promise: a textured image fills features_max, no two features are the same, and all lie inside the image.
TEST(OrbExtractor, fills_up) {
    Image image(640, 480);
    fill_leaves(image, 1);
    Rig rig(Limits::room(), cpu_kernels());
    ASSERT_EQ(rig.extractor.extract(image.view(), rig.features), Status::kOk);
    EXPECT_EQ(rig.features.size(), 1000u);
    std::set<std::tuple<float, float, int>> seen;
    for (const Keypoint& k : rig.features.keypoints.span()) {
        EXPECT_TRUE(k.x >= 0 && k.y >= 0 && k.x <= 639 && k.y <= 479);
        EXPECT_TRUE(seen.insert({k.x, k.y, k.level}).second);
    }
}

}  // namespace
}  // namespace stillmesh
