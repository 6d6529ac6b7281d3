#include "hal/live/depth_registration.hpp"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <random>

#include "engine/geometry/lens.hpp"
#include "engine/geometry/rigid_transform.hpp"

namespace stillmesh::depth_registration_test {
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

// Promise: the same with any pose between the cameras, some degrees and centimetres, and with lenses that bend on both
// sides: the obvious construction by the engine's own lenses, each pixel a square round its centre, as large as its
// distance makes it. What a pixel holds covers it with a square a tenth of a pixel larger (which is what the grid of
// the lens may be off), and nothing nearer covers it with one a tenth smaller.
TEST(DepthRegistration, FollowsPoseAndLenses) {
    std::mt19937 random(5);
    const auto within = [&random](double reach) {
        return reach * (2.0 * std::uniform_real_distribution<double>()(random) - 1.0);
    };
    for (int trial = 0; trial < 30; ++trial) {
        CameraModel depth = model(64, 48, 45 + trial), colour = model(96, 54, 70);
        if (trial % 3 == 1) depth.k1 = 0.1, depth.p1 = 0.002, colour.k1 = 0.2, colour.k2 = -0.4, colour.p2 = -0.003;
        if (trial % 3 == 2) colour.lens = Lens::kFisheye, colour.k1 = 0.03, colour.k2 = -0.01;
        RigidTransform pose;
        double norm = 1;
        for (int i = 0; i < 3; ++i) {
            pose.translation_m[i] = within(0.05);
            pose.rotation_xyzw[i] = within(0.03);
            norm -= pose.rotation_xyzw[i] * pose.rotation_xyzw[i];
        }
        pose.rotation_xyzw[3] = std::sqrt(norm);
        std::vector<std::uint16_t> source(64 * 48);
        for (std::uint32_t i = 0; i < source.size(); ++i) {  // blocks far apart: no two are one surface
            const std::uint32_t block = (i % 64 / 8 * 5 + i / 64 / 6 * 3) % 7;
            source[i] = static_cast<std::uint16_t>(block == 0 ? 0 : 600 * block);
        }
        std::vector<std::uint16_t> target(96 * 54, 9), nearest(target.size(), 65535);
        std::vector<std::vector<std::uint16_t>> possible(target.size());
        DepthRegistration(depth, colour, pose, 1000).reproject({source.data(), 64, 48, 64}, target.data());
        const auto [qx, qy, qz, qw] = pose.rotation_xyzw;
        for (std::uint32_t i = 0; i < source.size(); ++i) {
            if (source[i] == 0) continue;
            const ImagePoint ray = ray_of_pixel(depth, {double(i % 64), double(i / 64)});
            const double z = source[i] * 1e-3, p[3] = {ray.x * z, ray.y * z, z};
            // v + 2 w (q x v) + 2 q x (q x v): a rotation by a quaternion
            const double c[3] = {qy * p[2] - qz * p[1], qz * p[0] - qx * p[2], qx * p[1] - qy * p[0]};
            const double x = p[0] + 2 * qw * c[0] + 2 * (qy * c[2] - qz * c[1]) + pose.translation_m[0];
            const double y = p[1] + 2 * qw * c[1] + 2 * (qz * c[0] - qx * c[2]) + pose.translation_m[1];
            const double far = p[2] + 2 * qw * c[2] + 2 * (qx * c[1] - qy * c[0]) + pose.translation_m[2];
            const ImagePoint at = pixel_of_ray(colour, {x / far, y / far});
            const auto out_z = static_cast<std::uint16_t>(std::lround(far * 1000));
            const double half_x = 0.5 * colour.fx / depth.fx * z / far, half_y = 0.5 * colour.fy / depth.fy * z / far;
            for (std::size_t k = 0; k < target.size(); ++k) {
                const double off_x = std::abs(double(k % 96) - at.x) - half_x;
                const double off_y = std::abs(double(k / 96) - at.y) - half_y;
                const double off = std::max(off_x, off_y);
                if (off < -0.1) nearest[k] = std::min(nearest[k], out_z);
                if (off < 0.1) possible[k].push_back(out_z);
            }
        }
        int covered = 0;
        for (std::size_t k = 0; k < target.size(); ++k) {
            // Of one block all pixels have nearly one depth: its gaps are closed by any of them.
            const auto is_near = [&](std::uint16_t z) { return std::abs(int{z} - int{target[k]}) <= 40; };
            const bool is_one_of_them = std::any_of(possible[k].begin(), possible[k].end(), is_near);
            ASSERT_TRUE(is_one_of_them || (target[k] == 0 && nearest[k] == 65535))
                << trial << " " << k % 96 << " " << k / 96;
            ASSERT_TRUE(target[k] == 0 || target[k] <= nearest[k] + 40) << trial << " " << k % 96 << " " << k / 96;
            covered += target[k] > 0;
        }
        ASSERT_GT(covered, 1000) << trial;
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
}  // namespace stillmesh::depth_registration_test
