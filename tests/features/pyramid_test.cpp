#include "engine/frame/pyramid.hpp"

#include <gtest/gtest.h>

#include <cmath>
#include <memory>
#include <vector>

#include "platform/linux/cpu_kernels.hpp"
#include "tests/features/images.hpp"
#include "tests/features/rig.hpp"

namespace stillmesh::pyramid_test {
namespace {

using testing::Image;
using testing::Rig;

// Promise: every level, at every size, with every kernel, is the bilinear interpolation of the one before at the pixel
// centres, to within the rounding of weights (1/128 px) and grey levels (twice 1/2).
TEST(Pyramid, levels_are_bilinear) {
    for (const Kernels* kernels : {&plain_kernels(), sse2_kernels(), &cpu_kernels()}) {
        if (kernels == nullptr) continue;
        Rig rig(Limits::room(), *kernels);
        for (const auto& [width, height] :
             {std::pair{640u, 480u}, {33u, 33u}, {161u, 121u}, {639u, 37u}, {97u, 480u}}) {
            Image image(width, height, width + 5);
            fill_leaves(image, width, 200);
            ASSERT_EQ(rig.extractor.extract(image.view(), rig.features), Status::kOk);
            const Pyramid& pyramid = rig.extractor.pyramid();
            for (std::uint32_t y = 0; y < height; ++y)
                ASSERT_EQ(0, std::memcmp(pyramid.level(0).row(y), image.row(y), width));
            for (std::uint32_t i = 1; i < pyramid.levels(); ++i) {
                const GreyView from = pyramid.level(i - 1);
                const GreyView to = pyramid.level(i);
                EXPECT_EQ(to.width, std::lround(from.width / 1.2));
                EXPECT_EQ(to.height, std::lround(from.height / 1.2));
                for (std::uint32_t y = 0; y < to.height; ++y) {
                    const double sy = std::min((y + 0.5) * from.height / to.height - 0.5, from.height - 1.0);
                    const auto y0 = std::min(static_cast<std::uint32_t>(sy), from.height - 2);
                    for (std::uint32_t x = 0; x < to.width; ++x) {
                        const double sx = std::min((x + 0.5) * from.width / to.width - 0.5, from.width - 1.0);
                        const auto x0 = std::min(static_cast<std::uint32_t>(sx), from.width - 2);
                        const double a = sx - x0;
                        const double b = sy - y0;
                        const double exact = (1 - b) * ((1 - a) * from.at(x0, y0) + a * from.at(x0 + 1, y0)) +
                                             b * ((1 - a) * from.at(x0, y0 + 1) + a * from.at(x0 + 1, y0 + 1));
                        ASSERT_NEAR(to.at(x, y), exact, 1.0 + 2 * 255 / 128.0) << i << " " << x << " " << y;
                    }
                }
            }
        }
    }
}

// Promise: no level is shifted against the full image: the centre of mass of a blob, found on any level and taken back
// to the full image, is where it was, to 0.02 px of that level.
TEST(Pyramid, levels_are_not_shifted) {
    Rig rig(Limits::room(), cpu_kernels());
    for (const auto& [cx, cy] : {std::pair{320.0, 240.0}, {101.3, 399.7}, {560.5, 77.25}}) {
        Image image(640, 480);
        for (std::uint32_t y = 0; y < 480; ++y)
            for (std::uint32_t x = 0; x < 640; ++x)
                image.row(y)[x] = static_cast<std::uint8_t>(
                    std::lround(250 * std::exp(-((x - cx) * (x - cx) + (y - cy) * (y - cy)) / (2 * 14.0 * 14.0))));
        ASSERT_EQ(rig.extractor.extract(image.view(), rig.features), Status::kOk);
        const Pyramid& pyramid = rig.extractor.pyramid();
        for (std::uint32_t i = 0; i < 8; ++i) {
            double mass = 0;
            double mx = 0;
            double my = 0;
            const GreyView level = pyramid.level(i);
            for (std::uint32_t y = 0; y < level.height; ++y) {
                for (std::uint32_t x = 0; x < level.width; ++x) {
                    mass += level.at(x, y);
                    mx += level.at(x, y) * pyramid.full_x(i, x);
                    my += level.at(x, y) * pyramid.full_y(i, y);
                }
            }
            EXPECT_NEAR(mx / mass, cx, 0.02 * 640 / level.width) << "level " << i;
            EXPECT_NEAR(my / mass, cy, 0.02 * 480 / level.height) << "level " << i;
            EXPECT_NEAR(pyramid.level_x(i, pyramid.full_x(i, 12.25)), 12.25, 1e-9);
        }
    }
}

// Promise: what does not fit is refused and leaves nothing behind; small images have fewer levels.
TEST(Pyramid, sizes) {
    Rig rig(Limits::tiny(), cpu_kernels());
    Image image(170, 130);
    fill_noise(image, 1);
    const auto part = [&image](std::uint32_t width, std::uint32_t height) {
        return GreyView{image.pixels.data(), width, height, image.stride};
    };
    EXPECT_EQ(rig.extractor.extract(part(160, 120), rig.features), Status::kOk);
    EXPECT_EQ(rig.extractor.pyramid().levels(), 3u);
    EXPECT_EQ(rig.extractor.extract(part(161, 120), rig.features), Status::kInvalid);
    EXPECT_EQ(rig.extractor.pyramid().levels(), 0u);
    EXPECT_EQ(rig.features.size(), 0u);
    EXPECT_EQ(rig.extractor.extract(part(160, 121), rig.features), Status::kInvalid);
    EXPECT_EQ(rig.extractor.extract(part(32, 33), rig.features), Status::kInvalid);
    EXPECT_EQ(rig.extractor.extract(part(33, 32), rig.features), Status::kInvalid);
    EXPECT_EQ(rig.extractor.extract(GreyView{}, rig.features), Status::kInvalid);
    EXPECT_EQ(rig.extractor.extract(GreyView{image.pixels.data(), 100, 100, 99}, rig.features), Status::kInvalid);
    EXPECT_EQ(rig.extractor.extract(part(33, 33), rig.features), Status::kOk);
    EXPECT_EQ(rig.extractor.pyramid().levels(), 1u);
    EXPECT_EQ(rig.extractor.extract(part(160, 40), rig.features), Status::kOk);
    EXPECT_EQ(rig.extractor.pyramid().levels(), 2u);
}

}  // namespace
}  // namespace stillmesh::pyramid_test
