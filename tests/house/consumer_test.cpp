// A program as others write them: RTTI, exceptions, an Eigen of its own with SIMD and heap, and nothing of ours but the
// public headers and the engine library.
#include <gtest/gtest.h>

#include <Eigen/Dense>
#include <cstdint>
#include <cstdio>
#include <memory>
#include <typeinfo>

#include "engine/base/check.hpp"
#include "engine/features/features.hpp"
#include "engine/frame/frame.hpp"
#include "engine/limits.hpp"
#include "hal/depth_camera.hpp"

#if defined(EIGEN_DONT_VECTORIZE) || defined(EIGEN_NO_MALLOC)
#error "the engine's Eigen configuration leaked into a program that only links stillmesh::engine"
#endif

namespace stillmesh {
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

// Promise: a port's function that nobody wrote is a failed CHECK with its name, not a jump into nowhere.
TEST(ConsumerDeathTest, UnwrittenPortsSayTheirName) {
    set_check_handler(
        [](const char* expression, const char*, std::int32_t) noexcept { std::fprintf(stderr, "%s\n", expression); });
    Unfinished unfinished;
    FeatureSet features;
    EXPECT_DEATH(static_cast<void>(unfinished.extract({}, features)), "FeatureExtractor::extract not implemented");
    set_check_handler(nullptr);
    EXPECT_DEATH(STILLMESH_CHECK(1 + 1 == 3), "");
}

}  // namespace
}  // namespace stillmesh
