// What create() refuses is named by validate(): which of limits, configuration, camera and block, and which key.
#include <gtest/gtest.h>

#include <cmath>
#include <cstring>
#include <string>
#include <vector>

#include "engine/base/version.hpp"
#include "engine/engine.hpp"
#include "platform/linux/memory_block.hpp"

namespace stillmesh::words_test {
namespace {

constexpr Limits kLimits = Limits::tiny();

[[nodiscard]] CameraModel a_camera() {
    return {.width = 160, .height = 120, .fx = 130, .fy = 130, .cx = 79.5, .cy = 59.5};
}
[[nodiscard]] Status created(std::span<std::byte> block, const CameraModel& camera) {
    return Engine::create(block, kLimits, Configuration::for_limits(kLimits), camera, plain_kernels()).status();
}

// Promise: a block at any address is created in or refused with words, and nothing is written outside of it.
TEST(Words, AMisalignedBlockIsRefused) {
    const std::size_t size = bytes_needed(kLimits);
    std::vector<std::byte> memory(size + 2 * kArenaAlignment, std::byte{0x5a});
    std::size_t aligned = 0;
    for (std::size_t i = 0; i < kArenaAlignment; ++i) {
        const std::span<std::byte> block(memory.data() + i, size);
        const bool is_aligned = reinterpret_cast<std::uintptr_t>(block.data()) % kArenaAlignment == 0;
        const ConfigurationProblem problem = validate(block, kLimits);
        EXPECT_EQ(created(block, a_camera()), is_aligned ? Status::kOk : Status::kInvalid) << i;
        EXPECT_EQ(problem.key == nullptr, is_aligned);
        if (!is_aligned) {
            EXPECT_STREQ(problem.key, "block.address");
        }
        aligned += is_aligned;
    }
    EXPECT_EQ(aligned, 1U);
    EXPECT_EQ(memory.back(), std::byte{0x5a});
    EXPECT_STREQ(validate(std::span<const std::byte>(), kLimits).key, "block.bytes");
}

// Promise: the helper's block always does.
TEST(Words, AMemoryBlockIsTaken) {
    MemoryBlock block;
    ASSERT_TRUE(block.allocate(bytes_needed(kLimits)));
    EXPECT_EQ(validate(block.bytes(), kLimits).key, nullptr);
    EXPECT_EQ(created(block.bytes(), a_camera()), Status::kOk);
    ASSERT_TRUE(block.allocate(bytes_needed(kLimits) - 1));
    const ConfigurationProblem problem = validate(block.bytes(), kLimits);
    EXPECT_STREQ(problem.key, "block.bytes");
    EXPECT_EQ(problem.min, static_cast<double>(bytes_needed(kLimits)));
    EXPECT_EQ(created(block.bytes(), a_camera()), Status::kFull);
}

// Promise: a camera that create() refuses has a key and a sentence, and one that it takes has none.
TEST(Words, ACameraIsRefusedByName) {
    MemoryBlock block;
    ASSERT_TRUE(block.allocate(bytes_needed(kLimits)));
    struct Case {
        const char* key;
        void (*spoil)(CameraModel&);
    };
    const Case cases[] = {
        {"camera.width", [](CameraModel& c) { c.width = 161; }},
        {"camera.width", [](CameraModel& c) { c.width = 32; }},
        {"camera.height", [](CameraModel& c) { c.height = 0; }},
        {"camera.height", [](CameraModel& c) { c.height = 640; }},
        {"camera.fx", [](CameraModel& c) { c.fx = 0; }},
        {"camera.fy", [](CameraModel& c) { c.fy = std::nan(""); }},
        {"camera.lens", [](CameraModel& c) { c.cx = std::nan(""); }},
        {"camera.lens", [](CameraModel& c) { c.k1 = -5; }},
        {"camera.lens", [](CameraModel& c) { c.lens = Lens{9}; }},
    };
    for (const auto& [key, spoil] : cases) {
        CameraModel camera = a_camera();
        EXPECT_EQ(validate(camera, kLimits).key, nullptr);
        spoil(camera);
        const ConfigurationProblem problem = validate(camera, kLimits);
        ASSERT_NE(problem.key, nullptr) << key;
        EXPECT_STREQ(problem.key, key);
        EXPECT_GT(std::strlen(problem.sentence), 10U);
        EXPECT_EQ(created(block.bytes(), camera), Status::kInvalid) << key;
    }
}

// Promise: the default configuration, brought within any preset's limits, is taken; without that it is refused by name.
TEST(Words, AConfigurationForTheLimits) {
    EXPECT_STREQ(validate(Configuration{}, Limits::pocket()).key, "features.count");
    for (const Limits& limits : {Limits::room(), Limits::pocket(), Limits::tiny()}) {
        EXPECT_EQ(validate(Configuration::for_limits(limits), limits).key, nullptr);
        const Configuration outdoor = Configuration::outdoor().fitted_to(limits);
        EXPECT_EQ(validate(outdoor, limits).key, nullptr);
        EXPECT_EQ(outdoor.region.edge_change_max_m, Configuration::outdoor().region.edge_change_max_m);
        EXPECT_EQ(outdoor.features.count, std::min(1000U, limits.features_max));
    }
}

// Promise: the version can be compared by the preprocessor.
TEST(Words, AVersion) {
#if STILLMESH_VERSION < STILLMESH_VERSION_OF(0, 1, 0)
    FAIL();
#endif
    EXPECT_LT(STILLMESH_VERSION_OF(0, 9, 99), STILLMESH_VERSION_OF(0, 10, 0));
    EXPECT_EQ(STILLMESH_VERSION,
              STILLMESH_VERSION_MAJOR * 1000000 + STILLMESH_VERSION_MINOR * 1000 + STILLMESH_VERSION_PATCH);
}

}  // namespace
}  // namespace stillmesh::words_test
