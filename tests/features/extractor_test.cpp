#include <gtest/gtest.h>

#include <memory>
#include <set>
#include <vector>

#include "engine/features/orb_extractor.hpp"
#include "platform/linux/cpu_kernels.hpp"
#include "tests/features/images.hpp"

namespace stillmesh {
namespace {

using testing::Image;

struct Rig {
    explicit Rig(const Limits& limits, const Kernels& kernels, OrbOptions options = {}) {
        ArenaPlan arena_plan;
        OrbExtractor::plan(arena_plan, limits);
        FeatureSet::plan(arena_plan, limits.features_max);
        planned_bytes = arena_plan.used_bytes();
        block.reset(new (std::align_val_t(kArenaAlignment)) std::byte[planned_bytes]);
        Arena arena({block.get(), planned_bytes});
        if (options.features_max > limits.features_max) options.features_max = limits.features_max;
        if (options.levels > limits.pyramid_levels_max) options.levels = limits.pyramid_levels_max;
        extractor.create(arena, limits, options, kernels);
        features.create(arena, limits.features_max);
        used_bytes = arena.used_bytes();
    }
    struct Free {
        void operator()(std::byte* bytes) const { ::operator delete[](bytes, std::align_val_t(kArenaAlignment)); }
    };
    std::size_t planned_bytes = 0;
    std::size_t used_bytes = 0;
    std::unique_ptr<std::byte[], Free> block;
    OrbExtractor extractor;
    FeatureSet features;
};

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
