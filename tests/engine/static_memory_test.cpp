// The block as a user makes it at compile time, beside the library that is linked.
#include <gtest/gtest.h>

#include "engine/base/random.hpp"
#include "engine/static_bytes_needed.hpp"
#include "platform/linux/cpu_kernels.hpp"

namespace stillmesh::static_memory_test {
namespace {

alignas(kArenaAlignment) std::byte static_block[static_bytes_needed(Limits::pocket())];

// Promise: a block whose size the compiler worked out is what the engine of the library fills, to the byte.
TEST(StaticMemory, ABlockMadeByTheCompilerIsEnough) {
    CameraModel camera;
    camera.width = 640;
    camera.height = 480;
    camera.fx = camera.fy = 525;
    camera.cx = 319.5;
    camera.cy = 239.5;
    Configuration configuration;
    configuration.features.count = Limits::pocket().features_max;
    const auto made = Engine::create(static_block, Limits::pocket(), configuration, camera, cpu_kernels());
    ASSERT_TRUE(made.is_ok());
    EXPECT_EQ(made.value()->statistics().arena_used_bytes, sizeof(static_block));
}

// Promise: for the presets and any other limits, the compiler's number is the library's.
TEST(StaticMemory, EqualsBytesNeeded) {
    EXPECT_EQ(static_bytes_needed(Limits::room()), bytes_needed(Limits::room()));
    EXPECT_EQ(static_bytes_needed(Limits::pocket()), bytes_needed(Limits::pocket()));
    EXPECT_EQ(static_bytes_needed(Limits::tiny()), bytes_needed(Limits::tiny()));
    Random random(1);
    for (int i = 0; i < 1000; ++i) {
        Limits limits;
        limits.image_width_max = 64 + random.below(1984);
        limits.image_height_max = 64 + random.below(1984);
        limits.pyramid_levels_max = 1 + random.below(12);
        limits.features_max = 50 + random.below(4000);
        limits.keyframes_max = 2 + random.below(1000);
        limits.map_points_max = limits.features_max + random.below(50'000);
        limits.groups_max = 1 + random.below(200);
        ASSERT_EQ(static_bytes_needed(limits), bytes_needed(limits)) << i;
    }
}

}  // namespace
}  // namespace stillmesh::static_memory_test
