#include "platform/camera_check/depth_steps.hpp"

#include <gtest/gtest.h>

#include <cmath>
#include <cstdint>
#include <vector>

#include "engine/base/random.hpp"
#include "platform/camera_check/depth_edges.hpp"

namespace stillmesh::depth_steps_test {
namespace {

constexpr std::uint32_t kWidth = 640, kHeight = 480;

struct Picture {
    std::vector<std::uint8_t> grey = std::vector<std::uint8_t>(kWidth * kHeight, 100);
    std::vector<std::uint16_t> depth = std::vector<std::uint16_t>(kWidth * kHeight, 0);
    double units_per_m = 5000;
    [[nodiscard]] Frame frame() const {
        Frame f;
        f.colour = {grey.data(), kWidth, kHeight, kWidth};
        f.depth = {depth.data(), kWidth, kHeight, kWidth};
        f.depth_units_per_m = units_per_m;
        return f;
    }
};

// A floor from 1 to 5 m. `steps_per_disparity`: of inverse depth, 43.5 m times so many; `noise`: in steps.
Picture floor_seen(double steps_per_disparity, double noise, double units_per_m, std::uint64_t seed) {
    Random random(seed);
    Picture p;
    p.units_per_m = units_per_m;
    for (std::uint32_t y = 0; y < kHeight; ++y) {
        for (std::uint32_t x = 0; x < kWidth; ++x) {
            const double w = 0.2 + 0.8 * (y + 0.2 * x) / (kHeight + 0.2 * kWidth);
            double seen = w + noise * random.normal() / (43.5 * steps_per_disparity);
            if (steps_per_disparity > 0) {
                seen = std::round(seen * 43.5 * steps_per_disparity) / (43.5 * steps_per_disparity);
            }
            p.depth[y * kWidth + x] = static_cast<std::uint16_t>(std::lround(units_per_m / seen));
        }
    }
    return p;
}

double factor_of(Picture picture, double factor) {
    DepthSteps steps;
    picture.units_per_m /= factor;
    for (int i = 0; i < 5; ++i) steps.add(picture.frame());
    return steps.factor();
}

// Promise: the steps of a Kinect tell by how much the depth unit is off, in tenths of millimetres and in millimetres.
TEST(DepthSteps, TellTheUnit) {
    for (const double units : {5000.0, 1000.0}) {
        for (const double factor : {1.0, 5.0, 0.2, 2.0, 0.5, 10.0}) {
            const double found = factor_of(floor_seen(8, 0.4, units, 1), factor);
            EXPECT_NEAR(found / factor, 1.0, 0.1) << units << " units, " << factor << " times";
        }
    }
}

// Promise: depth without steps (time of flight), or with finer steps under the noise of a stereo camera, says nothing.
TEST(DepthSteps, OtherSensorsSayNothing) {
    Random random(3);
    Picture smooth = floor_seen(8, 0, 5000, 1);
    for (std::uint32_t i = 0; i < kWidth * kHeight; ++i) {
        const double w = 0.2 + 0.8 * (i / kWidth) / kHeight + 0.0015 * random.normal();
        smooth.depth[i] = static_cast<std::uint16_t>(std::lround(5000 / w));
    }
    EXPECT_EQ(factor_of(smooth, 1), 0.0);
    EXPECT_EQ(factor_of(floor_seen(16, 3.0, 5000, 2), 1), 0.0);
    EXPECT_EQ(factor_of(Picture(), 1), 0.0);
}

// Promise: where depth has a border and the picture has its edge beside it, the curve says how far, and to which side.
TEST(DepthEdges, SayWhereThePictureHasThem) {
    for (const int shift : {0, -17, 9}) {
        Picture p;
        for (std::uint32_t y = 0; y < kHeight; ++y) {
            for (std::uint32_t x = 0; x < kWidth; ++x) {
                const bool is_near = x >= 200 && x < 400;
                p.depth[y * kWidth + x] = is_near ? 5000 : 10000;
                const int from = static_cast<int>(x) - shift;
                if (from >= 200 && from < 400) p.grey[y * kWidth + x] = 160;
            }
        }
        EdgeCurve curve;
        add_depth_edges(p.frame(), curve);
        EXPECT_GT(curve.borders, 400);
        double best = 0;
        int at = 0;
        for (int i = -kEdgeShiftMax_px; i <= kEdgeShiftMax_px; ++i) {
            const double contrast = curve.contrast[static_cast<std::size_t>(i + kEdgeShiftMax_px)];
            if (contrast > best) {
                best = contrast;
                at = i;
            }
        }
        EXPECT_NEAR(at, shift, 1);
    }
}

}  // namespace
}  // namespace stillmesh::depth_steps_test
