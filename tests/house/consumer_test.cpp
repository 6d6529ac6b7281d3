// A program as others write them: RTTI, exceptions, an Eigen of its own with SIMD and heap, and nothing of ours but the
// public headers and the engine library.
#include <gtest/gtest.h>

#include <Eigen/Dense>
#include <cstdint>
#include <cstdio>
#include <memory>
#include <span>
#include <typeinfo>
#include <vector>

#include "engine/base/check.hpp"
#include "engine/engine.hpp"
#include "engine/features/features.hpp"
#include "engine/frame/frame.hpp"
#include "engine/limits.hpp"
#include "hal/depth_camera.hpp"

#if defined(EIGEN_DONT_VECTORIZE) || defined(EIGEN_NO_MALLOC)
#error "the engine's Eigen configuration leaked into a program that only links stillmesh::engine"
#endif

namespace stillmesh::consumer_test {
namespace {

class OneCorner : public FeatureExtractor {
public:
    virtual ~OneCorner() = default;
    [[nodiscard]] Status extract(const GreyView&, FeatureSet& features) noexcept override {
        features.clear();
        return features.keypoints.push({1, 2, 0, 3, 0}) && features.descriptors.push({}) ? Status::kOk : Status::kFull;
    }
};

class Unfinished : public FeatureExtractor {
public:
    virtual ~Unfinished() = default;
};

struct alignas(kArenaAlignment) Block {
    std::byte bytes[1 << 13];
};

// Promise: a program with RTTI and a vectorised Eigen links the engine and stands behind a port.
TEST(Consumer, ImplementsAPort) {
    const auto block = std::make_unique<Block>();
    Arena arena(block->bytes);
    FeatureSet features;
    features.create(arena, 10);
    const std::unique_ptr<OneCorner> own = std::make_unique<OneCorner>();
    FeatureExtractor& port = *own;
    EXPECT_EQ(port.extract({}, features), Status::kOk);
    EXPECT_EQ(features.size(), 1U);
    EXPECT_EQ(typeid(port), typeid(OneCorner));

    const Eigen::MatrixXd a = Eigen::MatrixXd::Identity(20, 20) * 2.0;
    EXPECT_EQ((a * a).trace(), 80.0);
    EXPECT_EQ((Eigen::Matrix3d::Identity() * Eigen::Matrix3d::Constant(2.0)).sum(), 18.0);
}

// Promise: the public headers and the library are all it takes to track: a block, a camera, frames in, poses out.
TEST(Consumer, TracksWithTheLibraryAlone) {
    const Limits limits = Limits::tiny();
    Configuration configuration;
    configuration.features.count = limits.features_max;
    configuration.features.levels = limits.pyramid_levels_max;
    configuration.mapping.window_keyframes = limits.keyframes_max;
    EXPECT_EQ(validate(configuration, limits).key, nullptr);
    configuration.features.count = limits.features_max + 1;
    EXPECT_STREQ(validate(configuration, limits).key, "features.count");
    configuration.features.count = limits.features_max;
    CameraModel camera;
    camera.width = limits.image_width_max;
    camera.height = limits.image_height_max;
    camera.fx = camera.fy = 130;
    camera.cx = 79.5;
    camera.cy = 59.5;

    const std::size_t size_bytes = bytes_needed(limits);
    EXPECT_LE(size_bytes, std::size_t{512} * 1024);
    const auto storage = std::make_unique<Block[]>(size_bytes / sizeof(Block) + 1);
    const std::span<std::byte> block(storage[0].bytes, size_bytes);
    EXPECT_EQ(Engine::create(block.first(size_bytes - 1), limits, configuration, camera, plain_kernels()).status(),
              Status::kFull);
    camera.width = 20;
    EXPECT_EQ(Engine::create(block, limits, configuration, camera, plain_kernels()).status(), Status::kInvalid);
    camera.width = limits.image_width_max;
    const Result<Engine*> made = Engine::create(block, limits, configuration, camera, plain_kernels());
    ASSERT_TRUE(made.is_ok());
    Engine& engine = *made.value();
    EXPECT_EQ(engine.statistics().arena_used_bytes, size_bytes);

    // A wall 2 m away with a pattern, passing by 2 pixels a frame: the camera moves along x by 2 * 2 m / 130.
    std::vector<std::uint8_t> grey(std::size_t{camera.width} * camera.height);
    const std::vector<std::uint16_t> depth(grey.size(), 10000);
    for (std::uint32_t i = 0; i < 10; ++i) {
        for (std::uint32_t y = 0; y < camera.height; ++y) {
            for (std::uint32_t x = 0; x < camera.width; ++x) {
                std::uint32_t cell = (x + 2 * i) / 8 * 2654435761U ^ y / 8 * 2246822519U;
                cell ^= cell >> 15U;
                grey[std::size_t{y} * camera.width + x] = static_cast<std::uint8_t>(cell * 97U);
            }
        }
        Frame frame;
        frame.time_ns = std::int64_t{i} * 33'000'000;
        frame.depth_time_ns = frame.time_ns;
        frame.format = PixelFormat::kGrey8;
        frame.colour = {grey.data(), camera.width, camera.height, camera.width};
        frame.depth = {depth.data(), camera.width, camera.height, camera.width};
        frame.depth_units_per_m = 5000;
        ASSERT_EQ(engine.submit(frame), Status::kOk);
        ASSERT_EQ(engine.submit(frame), Status::kInvalid);  // its time is not after the last one's
    }
    EXPECT_GE(engine.pose().state, PoseState::kUnsure) << pose_state_name(engine.pose().state);
    EXPECT_NEAR(engine.pose().odom_from_camera.translation_m[0], 9 * 4.0 / 130, 0.01);
    EXPECT_EQ(engine.statistics().frames_refused, 10U);
}

// Promise: a port's function that nobody wrote is a failed CHECK with its name, not a jump into nowhere.
TEST(ConsumerDeathTest, UnwrittenPortsSayTheirName) {
    Unfinished unfinished;
    FeatureSet features;
    EXPECT_DEATH(static_cast<void>(unfinished.extract({}, features)), "FeatureExtractor::extract not implemented");
}

}  // namespace
}  // namespace stillmesh::consumer_test

void stillmesh_check_failed(const char* expression, const char*, std::int32_t) noexcept {
    std::fprintf(stderr, "%s\n", expression);
}
