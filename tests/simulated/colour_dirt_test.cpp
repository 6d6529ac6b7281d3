#include "hal/simulated/colour_dirt.hpp"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>

#include "engine/base/hash.hpp"
#include "hal/simulated/depth_sensor.hpp"

namespace stillmesh::simulated::colour_dirt_test {
namespace {

std::vector<std::uint8_t> noisy(std::uint32_t width, std::uint32_t height) {
    std::vector<std::uint8_t> out(std::size_t{width} * height);
    for (std::size_t i = 0; i < out.size(); ++i) {
        const std::size_t x = i % width;
        out[i] = static_cast<std::uint8_t>(100 + x / 2 % 60 + scramble(static_cast<std::uint32_t>(i)) % 12);
    }
    return out;
}

// How rough neighbouring pixels are.
double roughness(const std::vector<std::uint8_t>& grey) {
    double sum = 0;
    for (std::size_t i = 1; i < grey.size(); ++i) sum += std::abs(grey[i] - grey[i - 1]);
    return sum / static_cast<double>(grey.size());
}

double difference(const std::vector<std::uint8_t>& a, const std::vector<std::uint8_t>& b) {
    double sum = 0;
    for (std::size_t i = 0; i < a.size(); ++i) sum += (a[i] - b[i]) * (a[i] - b[i]);
    return std::sqrt(sum / static_cast<double>(a.size()));
}

// Promise: the exposure hunts by a third to either side, as strongly as it is told, and not at all when off.
TEST(ColourDirt, ExposureHunts) {
    for (const double strength : {0.0, 0.5, 1.0}) {
        Dirt dirt = all_dirt(0);
        dirt.hunting = strength;
        const ColourDirt colour(dirt, 4);
        double least = 9;
        double most = 0;
        for (int i = 0; i < 3000; ++i) {
            const double factor = colour.exposure(i / 30.0);
            least = std::min(least, factor);
            most = std::max(most, factor);
        }
        EXPECT_NEAR(least, 1 - strength / 3, 0.02);
        EXPECT_NEAR(most, 1 + strength / 3, 0.02);
    }
}

// Promise: lamps flicker by 9 %, a hundred times a second.
TEST(ColourDirt, LampsFlicker) {
    Dirt dirt = all_dirt(0);
    EXPECT_EQ(ColourDirt(dirt, 1).lamps(0.3), 1.0);
    dirt.flicker = 1;
    const ColourDirt colour(dirt, 1);
    int rises = 0;
    double most = 0;
    for (int i = 1; i <= 10'000; ++i) {
        const double now = colour.lamps(i * 1e-4);
        most = std::max(most, std::abs(now - 1));
        rises += now > 1 && colour.lamps((i - 1) * 1e-4) <= 1;
    }
    EXPECT_NEAR(most, 0.09, 0.001);
    EXPECT_NEAR(rises, 100, 1);
}

// Promise: JPEG leaves what is even, takes away noise, and more of the picture the lower its quality.
TEST(Compress, TakesAwayWhatIsFine) {
    std::vector<std::uint8_t> even(64 * 48, 137);
    compress(even, 64, 48, 70);
    for (const std::uint8_t grey : even) ASSERT_NEAR(grey, 137, 1);
    const std::vector<std::uint8_t> before = noisy(64, 48);
    double last = 0;
    for (const std::int32_t quality : {100, 90, 70, 40, 10}) {
        std::vector<std::uint8_t> after = before;
        compress(after, 64, 48, quality);
        const double lost = difference(before, after);
        EXPECT_GT(lost, last) << quality;
        last = lost;
        if (quality == 100) {
            EXPECT_LT(lost, 0.6);
        }
        if (quality == 70) {
            EXPECT_LT(roughness(after), 0.9 * roughness(before));
            EXPECT_LT(lost, 6);
        }
    }
}

// Promise: sizes that are no multiple of eight are whole, too.
TEST(Compress, TakesAnySize) {
    const std::vector<std::uint8_t> before = noisy(51, 37);
    std::vector<std::uint8_t> after = before;
    compress(after, 51, 37, 95);
    EXPECT_LT(difference(before, after), 3);
}

// Promise: these bytes on every processor, compiler and optimisation level.
TEST(Compress, IsTheSameEverywhere) {
    std::vector<std::uint8_t> grey = noisy(64, 48);
    compress(grey, 64, 48, 70);
    StateHash hash;
    for (const std::uint8_t value : grey) hash.add(static_cast<std::uint32_t>(value));
    EXPECT_EQ(hash.value(), 8203808967219412415U);
}

}  // namespace
}  // namespace stillmesh::simulated::colour_dirt_test
