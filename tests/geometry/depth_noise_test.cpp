#include "engine/geometry/depth_noise.hpp"

#include <gtest/gtest.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <cstdio>
#include <utility>
#include <vector>

#include "engine/base/random.hpp"

namespace stillmesh::depth_noise_test {
namespace {

constexpr double kUnit = 1.0 / 5000.0;
constexpr std::array<double, 9> kWeights = {1, 2, 1, 2, 4, 2, 1, 2, 1};

struct DepthImage {
    std::uint32_t width = 0;
    std::uint32_t height = 0;
    std::vector<std::uint16_t> pixels;
    [[nodiscard]] DepthView view() const { return {pixels.data(), width, height, width}; }
};

DepthImage image_of(std::uint32_t width, std::uint32_t height, std::vector<std::uint16_t> pixels) {
    return {width, height, std::move(pixels)};
}

DepthParameters without_limits() {
    DepthParameters noise;
    noise.z_min_m = 0;
    noise.z_max_m = 1e9;
    noise.sigma_max_m = 1e9;
    return noise;
}

// method.md 1, word by word: two passes, metres, the centred form.
DepthSample by_the_book(const DepthImage& image, int x, int y, const DepthParameters& noise) {
    double weight_sum = 0, mean = 0;
    const auto visit = [&](auto use) {
        for (int dy = -1; dy <= 1; ++dy) {
            for (int dx = -1; dx <= 1; ++dx) {
                const int px = x + dx, py = y + dy;
                if (px < 0 || py < 0 || px >= static_cast<int>(image.width) || py >= static_cast<int>(image.height))
                    continue;
                const std::uint16_t d = image.view().at(static_cast<std::uint32_t>(px), static_cast<std::uint32_t>(py));
                if (d != 0) use(kWeights[static_cast<std::size_t>((dy + 1) * 3 + dx + 1)] / 16, d * kUnit);
            }
        }
    };
    visit([&](double w, double z) {
        weight_sum += w;
        mean += w * z;
    });
    if (weight_sum == 0) return {};
    mean /= weight_sum;
    double variance = 0;
    visit([&](double w, double z) {
        const double sigma = noise.sigma_z_per_m2 * z * z;
        variance += w / weight_sum * (sigma * sigma + (z - mean) * (z - mean));
    });
    if (mean > noise.z_max_m || mean < noise.z_min_m || std::sqrt(variance) > noise.sigma_max_m) return {};
    return {mean, variance};
}

// Promise: the sample is the mixture of method.md 1, for surfaces, borders, holes and image corners.
TEST(SampleDepth, IsTheMixtureByTheBook) {
    Random random(1);
    const DepthParameters noise;
    int valid = 0, invalid = 0;
    for (int round = 0; round < 20'000; ++round) {
        DepthImage image{5, 4, std::vector<std::uint16_t>(20)};
        const std::uint32_t near = 2000 + random.below(20000);
        const std::uint32_t far = near + random.below(round % 2 == 0 ? 30 : 8000);
        for (std::uint16_t& d : image.pixels) {
            const std::uint32_t kind = random.below(10);
            d = static_cast<std::uint16_t>(kind < 3 ? 0 : (kind < 7 ? near + random.below(20) : far));
        }
        const int x = static_cast<int>(random.below(7)) - 1;
        const int y = static_cast<int>(random.below(6)) - 1;
        const bool is_inside = x >= 0 && y >= 0 && x < 5 && y < 4;
        const DepthSample got = sample_depth(image.view(), kUnit, x, y, noise);
        const DepthSample want = is_inside ? by_the_book(image, x, y, noise) : DepthSample{};
        ASSERT_EQ(got.is_valid(), want.is_valid());
        if (got.is_valid()) {
            ++valid;
            ASSERT_NEAR(got.mean_m, want.mean_m, 1e-14 * want.mean_m);
            ASSERT_NEAR(got.variance_m2, want.variance_m2, 1e-11 * want.variance_m2);
        } else {
            ++invalid;
        }
    }
    EXPECT_GT(valid, 1000);
    EXPECT_GT(invalid, 1000);
}

// Promise: on a flat surface the deviation is Khoshelham's 1.425e-3 z^2; nothing else comes in.
TEST(SampleDepth, FlatSurfaceHasTheSensorsNoise) {
    for (const int units : {2500, 5000, 15000, 25000}) {
        const DepthImage image = image_of(3, 3, std::vector<std::uint16_t>(9, static_cast<std::uint16_t>(units)));
        const DepthSample sample = sample_depth(image.view(), kUnit, 1, 1, DepthParameters{});
        const double z = units * kUnit;
        EXPECT_NEAR(sample.mean_m, z, 1e-15);
        EXPECT_NEAR(std::sqrt(sample.variance_m2), 1.425e-3 * z * z, 1e-15);
    }
}

// Promise: a feature on an object's border gets a large variance by itself and is isolated; beyond z_max and before
// z_min too; a hole is no measurement.
TEST(SampleDepth, BordersAndLimitsAreIsolated) {
    const DepthParameters noise;
    const auto at = [&](std::vector<std::uint16_t> pixels) {
        const DepthImage image = image_of(3, 3, std::move(pixels));
        return sample_depth(image.view(), kUnit, 1, 1, noise);
    };
    const DepthSample step = at({5000, 5000, 6000, 5000, 5000, 6000, 5000, 5000, 6000});  // 1.0 and 1.2 m
    ASSERT_TRUE(step.is_valid());
    EXPECT_GT(std::sqrt(step.variance_m2), 0.08);
    EXPECT_FALSE(at({5000, 5000, 10000, 5000, 5000, 10000, 5000, 5000, 10000}).is_valid());
    EXPECT_FALSE(at(std::vector<std::uint16_t>(9, 30100)).is_valid()) << "6.02 m";
    EXPECT_TRUE(at(std::vector<std::uint16_t>(9, 29000)).is_valid()) << "5.8 m";
    EXPECT_FALSE(at(std::vector<std::uint16_t>(9, 1400)).is_valid()) << "0.28 m";
    EXPECT_FALSE(at(std::vector<std::uint16_t>(9, 0)).is_valid());
    EXPECT_TRUE(at({0, 0, 0, 0, 0, 0, 0, 0, 5000}).is_valid()) << "one valid neighbour is enough";
}

// Promise: the largest depths a sensor can write do not overflow anything.
TEST(SampleDepth, LargestDepths) {
    const DepthImage image = image_of(3, 3, {65535, 1, 65535, 65535, 65535, 65535, 1, 1, 65535});
    const DepthParameters noise = without_limits();
    const DepthSample got = sample_depth(image.view(), kUnit, 1, 1, noise);
    const DepthSample want = by_the_book(image, 1, 1, noise);
    EXPECT_NEAR(got.mean_m, want.mean_m, 1e-13);
    EXPECT_NEAR(got.variance_m2, want.variance_m2, 1e-11);
}

// Promise: mean and variance are those of the mixture: draw a pixel by its weight, add the sensor's noise.
TEST(SampleDepth, MonteCarlo) {
    const DepthImage image = image_of(3, 3, {5000, 5100, 5600, 0, 5050, 5500, 4950, 5000, 5400});
    const DepthParameters noise;
    const DepthSample sample = sample_depth(image.view(), kUnit, 1, 1, noise);
    ASSERT_TRUE(sample.is_valid());
    Random random(2);
    const int draws = 400'000;
    double sum = 0, sum2 = 0;
    int n = 0;
    while (n < draws) {
        double dice = random.uniform() * 16;
        std::size_t pixel = 0;
        while (pixel < 8 && dice >= kWeights[pixel]) dice -= kWeights[pixel++];
        const double z = image.pixels[pixel] * kUnit;
        if (z == 0) continue;  // drawn again: the weights are renormalised over the valid pixels
        const double drawn = z + random.normal() * noise.sigma_z_per_m2 * z * z;
        sum += drawn - sample.mean_m;
        sum2 += (drawn - sample.mean_m) * (drawn - sample.mean_m);
        ++n;
    }
    EXPECT_NEAR(sum / n, 0.0, 5 * std::sqrt(sample.variance_m2 / n));
    EXPECT_NEAR(sum2 / n / sample.variance_m2, 1.0, 0.02);
}

}  // namespace
}  // namespace stillmesh::depth_noise_test
