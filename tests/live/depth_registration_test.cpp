#include "hal/live/depth_registration.hpp"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <random>

namespace stillmesh {
namespace {

CameraModel model(std::uint32_t width, std::uint32_t height, double fx) {
    CameraModel m;
    m.width = width;
    m.height = height;
    m.fx = m.fy = fx;
    m.cx = (width - 1) / 2.0;
    m.cy = (height - 1) / 2.0;
    return m;
}

// Promise: on random blocks at random distances it is the obvious construction in double: every target pixel holds the
// nearest of all source pixels whose square covers its centre, and nothing else (surfaces are flat here, so that
// closing gaps changes nothing).
TEST(DepthRegistration, IsTheNearestOfAllThatCover) {
    std::mt19937 random(11);
    for (int trial = 0; trial < 40; ++trial) {
        CameraModel depth = model(64, 48, 50 + trial);
        depth.cx += 0.1371;  // no edge falls on a centre
        depth.cy -= 0.2113;
        const CameraModel colour = model(trial % 2 == 0 ? 64 : 96, trial % 2 == 0 ? 48 : 72, 60);
        const double baseline_m = trial % 3 == 0 ? -0.025 : 0.025;
        std::vector<std::uint16_t> source(64 * 48, 4000);
        for (int block = 0; block < 6; ++block) {
            const std::uint64_t x0 = random() % 60, y0 = random() % 44, w = 2 + random() % 20, h = 2 + random() % 20;
            const auto z = static_cast<std::uint16_t>(random() % 4 == 0 ? 0 : 500 + 500 * (random() % 6));
            for (std::uint64_t y = y0; y < std::min<std::uint64_t>(y0 + h, 48); ++y) {
                for (std::uint64_t x = x0; x < std::min<std::uint64_t>(x0 + w, 64); ++x) source[y * 64 + x] = z;
            }
        }
        const std::size_t pixels = std::size_t{colour.width} * colour.height;
        std::vector<std::uint16_t> target(pixels, 9), lowest(pixels, 0), highest(pixels, 0);
        DepthRegistration(depth, colour, baseline_m, 1000).reproject({source.data(), 64, 48, 64}, target.data());
        // Twice, with squares a hair smaller and larger: rounding in float may decide either way in between.
        for (const bool is_large : {false, true}) {
            std::vector<std::uint16_t>& expected = is_large ? highest : lowest;
            const double half = 0.5 + (is_large ? 1e-3 : -1e-3);
            for (std::uint32_t y = 0; y < 48; ++y) {
                for (std::uint32_t x = 0; x < 64; ++x) {
                    const std::uint16_t z = source[y * 64 + x];
                    if (z == 0) continue;
                    for (std::uint32_t v = 0; v < colour.height; ++v) {
                        const double top = (y - half - depth.cy) / depth.fy * colour.fy + colour.cy;
                        const double bottom = (y + half - depth.cy) / depth.fy * colour.fy + colour.cy;
                        if (v < top || v > bottom) continue;
                        for (std::uint32_t u = 0; u < colour.width; ++u) {
                            const double shift = colour.fx * baseline_m * 1000 / z;
                            const double left = (x - half - depth.cx) / depth.fx * colour.fx + colour.cx - shift;
                            const double right = (x + half - depth.cx) / depth.fx * colour.fx + colour.cx - shift;
                            if (u < left || u > right) continue;
                            std::uint16_t& out = expected[v * colour.width + u];
                            if (out == 0 || z < out) out = z;
                        }
                    }
                }
            }
        }
        for (std::size_t i = 0; i < pixels; ++i) {
            ASSERT_TRUE(target[i] == lowest[i] || target[i] == highest[i]) << trial << " " << i;
        }
    }
}

// Promise: a person before a wall: the wall does not shine through anywhere, though the person's pixels spread when the
// target is larger; where only the wall's hidden part would be seen there is no depth.
TEST(DepthRegistration, NothingShinesThrough) {
    const CameraModel depth = model(320, 240, 262);
    const CameraModel colour = model(640, 480, 525);
    std::vector<std::uint16_t> source(320 * 240, 4000);
    for (std::uint32_t y = 60; y < 240; ++y) {
        for (std::uint32_t x = 120; x < 200; ++x) source[y * 320 + x] = 800;
    }
    std::vector<std::uint16_t> target(640 * 480);
    DepthRegistration(depth, colour, 0.025, 1000).reproject({source.data(), 320, 240, 320}, target.data());
    const double shift_near = 525 * 0.025 / 0.8;
    const double shift_far = 525 * 0.025 / 4.0;
    for (std::uint32_t y = 140; y < 470; ++y) {
        const std::uint16_t* const row = target.data() + y * 640;
        const auto begin = static_cast<std::uint32_t>(240 - shift_near + 2);
        const auto end = static_cast<std::uint32_t>(400 - shift_near - 2);
        for (std::uint32_t x = begin; x < end; ++x) ASSERT_EQ(row[x], 800) << x << " " << y;
        // Behind the person's right edge the depth camera saw nothing that the colour camera sees there.
        for (std::uint32_t x = end + 4; x < static_cast<std::uint32_t>(400 - shift_far - 3); ++x) {
            ASSERT_EQ(row[x], 0) << x << " " << y;
        }
    }
}

// Promise: a slanted wall has no gaps: every row is full from its first to its last pixel.
TEST(DepthRegistration, SlantedSurfacesHaveNoGaps) {
    const CameraModel m = model(320, 240, 262);
    for (const double slope : {-6.0, -2.0, 2.0, 6.0}) {
        std::vector<std::uint16_t> source(320 * 240);
        for (std::uint32_t i = 0; i < source.size(); ++i) {
            source[i] = static_cast<std::uint16_t>(2500 + slope * (static_cast<double>(i % 320) - 160));
        }
        std::vector<std::uint16_t> target(320 * 240);
        DepthRegistration(m, m, 0.05, 1000).reproject({source.data(), 320, 240, 320}, target.data());
        for (std::uint32_t y = 0; y < 240; ++y) {
            const std::uint16_t* const row = target.data() + y * 320;
            std::uint32_t last = 319;
            while (last > 0 && row[last] == 0) --last;
            ASSERT_GT(last, 300U);
            for (std::uint32_t x = 0; x <= last; ++x) ASSERT_GT(row[x], 0) << slope << " " << x << " " << y;
        }
    }
}

}  // namespace
}  // namespace stillmesh
