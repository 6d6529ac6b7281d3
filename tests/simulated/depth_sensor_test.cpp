#include "hal/simulated/depth_sensor.hpp"

#include <gtest/gtest.h>

#include <cmath>
#include <set>

namespace stillmesh::simulated::depth_sensor_test {
namespace {

constexpr Pinhole kPinhole{320, 240, 264, 264, 159.5, 119.5};
constexpr float kUnits = 5000.0F;

class Walls {
public:
    Walls() : texture_(paint(Pattern::kDark, 1)), renderer_(kPinhole) { renderer_.begin(Rigid{}, 0, 0); }

    // A wall across the view at depth z, from x0 to x1 (tangents of the viewing angle).
    void add(double z, double x0 = -2, double x1 = 2) {
        Vertex v[4];
        v[0].p = {x0 * z, -2 * z, z};
        v[1].p = {x1 * z, -2 * z, z};
        v[2].p = {x1 * z, 2 * z, z};
        v[3].p = {x0 * z, 2 * z, z};
        renderer_.draw(v, 4, {&texture_, Infrared::kGood, false});
    }
    [[nodiscard]] std::vector<std::uint16_t> sense(std::uint64_t seed) const {
        std::vector<std::uint16_t> depth;
        DepthSensor(kPinhole.width, kPinhole.height).sense(renderer_, seed, kUnits, depth);
        return depth;
    }

private:
    Texture texture_;
    Renderer renderer_;
};

// Promise: noise grows as 1.425e-3 z^2, depth is right in the mean, and few pixels of a plain wall are missing.
TEST(DepthSensor, NoiseGrowsWithTheSquareOfDepth) {
    for (const double z : {0.8, 1.5, 2.5, 3.37, 4.1}) {
        Walls walls;
        walls.add(z);
        double sum = 0;
        double squares = 0;
        std::size_t count = 0;
        std::size_t pixels = 0;
        for (std::uint64_t seed = 1; seed <= 4; ++seed) {
            for (const std::uint16_t d : walls.sense(seed * 7919)) {
                ++pixels;
                if (d == 0) continue;
                const double error = d / 5000.0 - z;
                sum += error;
                squares += error * error;
                ++count;
            }
        }
        const auto n = static_cast<double>(count);
        const double sigma = 1.425e-3 * z * z;
        EXPECT_GT(n / static_cast<double>(pixels), 0.97) << z;
        EXPECT_LT(std::abs(sum / n), 0.5 * sigma) << z;  // a step of disparity may lie to one side
        EXPECT_NEAR(std::sqrt(squares / n) / sigma, 1.0, 0.2) << z;
    }
}

// Promise: disparity comes in eighths of a pixel: at 3 m neighbouring values are 26 mm apart.
TEST(DepthSensor, DisparityIsQuantised) {
    Walls walls;
    walls.add(3.0);
    std::set<std::uint16_t> values;
    for (const std::uint16_t d : walls.sense(5)) {
        if (d != 0) values.insert(d);
    }
    EXPECT_LT(values.size(), 8U);
    EXPECT_GT(values.size(), 2U);
    std::uint16_t last = 0;
    for (const std::uint16_t d : values) {
        if (last != 0) {
            EXPECT_NEAR((d - last) / 5000.0, 9.0 / (43.5 * 8), 0.003);
        }
        last = d;
    }
}

// Promise: nothing nearer than 0.5 m and nothing farther than 4.5 m is measured.
TEST(DepthSensor, HasARange) {
    for (const double z : {0.2, 0.47, 4.8, 8.0}) {
        Walls walls;
        walls.add(z);
        for (const std::uint16_t d : walls.sense(1)) ASSERT_EQ(d, 0) << z;
    }
}

// Promise: to the left of a near thing lies its shadow, as wide as the difference of disparities.
TEST(DepthSensor, NearThingsCastAShadow) {
    Walls walls;
    walls.add(3.0);
    walls.add(1.0, 0.0, 0.2);
    const std::vector<std::uint16_t> depth = walls.sense(2);
    const double wanted = 43.5 * (264.0 / 580.0) * (1.0 - 1.0 / 3.0);
    double missing = 0;
    for (std::uint32_t y = 0; y < kPinhole.height; ++y) {
        for (std::uint32_t x = 160 - 25; x < 160; ++x) missing += depth[y * kPinhole.width + x] == 0;
    }
    EXPECT_NEAR(missing / kPinhole.height, wanted, 2.0);
    missing = 0;
    for (std::uint32_t y = 0; y < kPinhole.height; ++y) {
        for (std::uint32_t x = 215; x < 240; ++x) missing += depth[y * kPinhole.width + x] == 0;
    }
    EXPECT_LT(missing / kPinhole.height, 1.0);  // none on the other side
}

}  // namespace
}  // namespace stillmesh::simulated::depth_sensor_test
