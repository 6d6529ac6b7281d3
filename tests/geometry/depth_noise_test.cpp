#include "engine/geometry/depth_noise.hpp"

#include <gtest/gtest.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <cstdio>
#include <utility>
#include <vector>

#include "engine/base/random.hpp"

namespace stillmesh {
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

DepthNoise without_limits() {
    DepthNoise noise;
    noise.z_min_m = 0;
    noise.z_max_m = 1e9;
    noise.sigma_max_m = 1e9;
    return noise;
}

// method.md 1, word by word: two passes, metres, the centred form.
DepthSample by_the_book(const DepthImage& image, int x, int y, const DepthNoise& noise) {
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
    const DepthNoise noise;
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
        const DepthSample sample = sample_depth(image.view(), kUnit, 1, 1, DepthNoise{});
        const double z = units * kUnit;
        EXPECT_NEAR(sample.mean_m, z, 1e-15);
        EXPECT_NEAR(std::sqrt(sample.variance_m2), 1.425e-3 * z * z, 1e-15);
    }
}

// Promise: a feature on an object's border gets a large variance by itself and is isolated; beyond z_max and before
// z_min too; a hole is no measurement.
TEST(SampleDepth, BordersAndLimitsAreIsolated) {
    const DepthNoise noise;
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
    const DepthNoise noise = without_limits();
    const DepthSample got = sample_depth(image.view(), kUnit, 1, 1, noise);
    const DepthSample want = by_the_book(image, 1, 1, noise);
    EXPECT_NEAR(got.mean_m, want.mean_m, 1e-13);
    EXPECT_NEAR(got.variance_m2, want.variance_m2, 1e-11);
}

// Promise: mean and variance are those of the mixture: draw a pixel by its weight, add the sensor's noise.
TEST(SampleDepth, MonteCarlo) {
    const DepthImage image = image_of(3, 3, {5000, 5100, 5600, 0, 5050, 5500, 4950, 5000, 5400});
    const DepthNoise noise;
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

Matrix3 sample_covariance(const std::vector<Vector3>& points) {
    Vector3 mean = Vector3::Zero();
    for (const Vector3& p : points) mean += p;
    mean /= static_cast<double>(points.size());
    Matrix3 covariance = Matrix3::Zero();
    for (const Vector3& p : points) covariance += (p - mean) * (p - mean).transpose();
    return covariance / static_cast<double>(points.size());
}

// Entry by entry, in units of the entry's own two deviations: 1 is 100 % correlation's worth.
double largest_relative_difference(const Matrix3& a, const Matrix3& b) {
    double worst = 0;
    for (int r = 0; r < 3; ++r) {
        for (int c = 0; c < 3; ++c)
            worst = std::max(worst, std::fabs(a(r, c) - b(r, c)) / std::sqrt(b(r, r) * b(c, c)));
    }
    return worst;
}

CameraModel camera() {
    return {640, 480, 525, 510, 319.5, 239.5};
}

// Promise: the covariance of a point is that of (x z, y z, z) with independent pixel and depth noise: Monte Carlo.
TEST(PointCovariance, MonteCarlo) {
    Random random(3);
    const CameraModel model = camera();
    for (int i = 0; i < 12; ++i) {
        const Vector2 n(random.uniform(-0.6, 0.6), random.uniform(-0.45, 0.45));
        const DepthSample sample{random.uniform(0.5, 5.0), std::pow(random.uniform(0.005, 0.15), 2)};
        const double sigma_pixel = std::pow(1.2, random.below(8));
        std::vector<Vector3> points;
        for (int k = 0; k < 40'000; ++k) {
            const double z = sample.mean_m + random.normal() * std::sqrt(sample.variance_m2);
            const Vector2 moved(n.x() + random.normal() * sigma_pixel / model.fx,
                                n.y() + random.normal() * sigma_pixel / model.fy);
            points.push_back(back_project(moved, z));
        }
        const Matrix3 covariance = point_covariance(model, n, sample, sigma_pixel);
        EXPECT_LT(largest_relative_difference(sample_covariance(points), covariance), 0.04);
    }
}

// Promise: to first order the covariance is J diag(sigma) J^T with J by numerical differentiation; the only term beyond
// it is sigma_u^2 var / f^2, as method.md 1 has it. Symmetric and positive definite.
TEST(PointCovariance, NumericalDifferentiation) {
    Random random(4);
    const CameraModel model = camera();
    for (int i = 0; i < 2000; ++i) {
        const Vector2 pixel(random.uniform(0, 639), random.uniform(0, 479));
        const DepthSample sample{random.uniform(0.5, 5.0), std::pow(random.uniform(0.001, 0.15), 2)};
        const double sigma_pixel = random.uniform(0.5, 4.0);
        const auto point = [&](double u, double v, double z) {
            return Vector3((u - model.cx) / model.fx * z, (v - model.cy) / model.fy * z, z);
        };
        const double h = 1e-4;
        Matrix3 j;
        j.col(0) =
            (point(pixel.x() + h, pixel.y(), sample.mean_m) - point(pixel.x() - h, pixel.y(), sample.mean_m)) / (2 * h);
        j.col(1) =
            (point(pixel.x(), pixel.y() + h, sample.mean_m) - point(pixel.x(), pixel.y() - h, sample.mean_m)) / (2 * h);
        j.col(2) =
            (point(pixel.x(), pixel.y(), sample.mean_m + h) - point(pixel.x(), pixel.y(), sample.mean_m - h)) / (2 * h);
        const double s2 = sigma_pixel * sigma_pixel;
        Matrix3 want = j * Vector3(s2, s2, sample.variance_m2).asDiagonal() * j.transpose();
        want(0, 0) += s2 * sample.variance_m2 / (model.fx * model.fx);
        want(1, 1) += s2 * sample.variance_m2 / (model.fy * model.fy);
        const Vector2 n((pixel.x() - model.cx) / model.fx, (pixel.y() - model.cy) / model.fy);
        const Matrix3 got = point_covariance(model, n, sample, sigma_pixel);
        ASSERT_LT(largest_relative_difference(got, want), 1e-8);
        ASSERT_EQ(got, got.transpose());
        ASSERT_GT(got.determinant(), 0.0);
        ASSERT_GT(got(0, 0) * got(1, 1) - got(0, 1) * got(0, 1), 0.0);
    }
}

StereoAngles random_angles(Random& random) {
    const double w2 = random.uniform(-0.5, 0.4);
    const double phi = random.uniform(-0.4, 0.4);
    return {w2 + random.uniform(0.02, 0.2), w2, phi, phi + random.uniform(-1e-3, 1e-3)};
}

double angle_of(const StereoAngles& a, int i) {
    return i == 0 ? a.w1_rad : (i == 1 ? a.w2_rad : (i == 2 ? a.phi1_rad : a.phi2_rad));
}
StereoAngles with_angle(StereoAngles a, int i, double value) {
    (i == 0 ? a.w1_rad : (i == 1 ? a.w2_rad : (i == 2 ? a.phi1_rad : a.phi2_rad))) = value;
    return a;
}
double sigma_of(const StereoNoise& s, int i) {
    return i == 0 ? s.sigma_w1_rad : (i == 1 ? s.sigma_w2_rad : (i == 2 ? s.sigma_phi1_rad : s.sigma_phi2_rad));
}

// Promise: the stereo point is where the two rays meet, and its covariance J diag J^T with J by central differences;
// sigma_Z is the closed form of method.md 1.
TEST(Stereo, NumericalDifferentiation) {
    Random random(5);
    const StereoNoise noise{0.11, 4e-4, 6e-4, 3e-4, 5e-4};
    for (int i = 0; i < 2000; ++i) {
        const StereoAngles angles = random_angles(random);
        const StereoPoint got = stereo_point(angles, noise);
        const double a = std::tan(angles.w1_rad), b = std::tan(angles.w2_rad);
        const double z = noise.baseline_m / (a - b);
        ASSERT_NEAR(got.point.z(), z, 1e-12 * z);
        ASSERT_NEAR(got.point.x(), a * z, 1e-12 * z);
        ASSERT_NEAR(got.point.y(), z * (std::tan(angles.phi1_rad) + std::tan(angles.phi2_rad)) / 2, 1e-12 * z);

        Matrix3 want = Matrix3::Zero();
        for (int k = 0; k < 4; ++k) {
            const double h = 1e-6;
            const Vector3 column = (stereo_point(with_angle(angles, k, angle_of(angles, k) + h), noise).point -
                                    stereo_point(with_angle(angles, k, angle_of(angles, k) - h), noise).point) /
                                   (2 * h);
            want += column * column.transpose() * sigma_of(noise, k) * sigma_of(noise, k);
        }
        ASSERT_LT(largest_relative_difference(got.covariance, want), 1e-6);
        ASSERT_EQ(got.covariance, got.covariance.transpose());

        const double sec1 = 1 / std::cos(angles.w1_rad), sec2 = 1 / std::cos(angles.w2_rad);
        const double closed =
            std::pow(z, 4) / std::pow(noise.baseline_m, 2) *
            (std::pow(sec1, 4) * std::pow(noise.sigma_w1_rad, 2) + std::pow(sec2, 4) * std::pow(noise.sigma_w2_rad, 2));
        ASSERT_NEAR(got.covariance(2, 2), closed, 1e-11 * closed);
    }
}

// Promise: drawn angles scatter as the covariance says, where the noise is small beside the disparity.
TEST(Stereo, MonteCarlo) {
    Random random(6);
    const StereoNoise noise{0.12, 2e-4, 3e-4, 4e-4, 1e-4};
    for (int i = 0; i < 8; ++i) {
        const StereoAngles angles = random_angles(random);
        std::vector<Vector3> points;
        for (int k = 0; k < 40'000; ++k) {
            StereoAngles drawn = angles;
            drawn.w1_rad += random.normal() * noise.sigma_w1_rad;
            drawn.w2_rad += random.normal() * noise.sigma_w2_rad;
            drawn.phi1_rad += random.normal() * noise.sigma_phi1_rad;
            drawn.phi2_rad += random.normal() * noise.sigma_phi2_rad;
            points.push_back(stereo_point(drawn, noise).point);
        }
        EXPECT_LT(largest_relative_difference(sample_covariance(points), stereo_point(angles, noise).covariance), 0.05);
    }
}

// Promise: rays that never meet in front have no point, and say so by a negative trace.
TEST(Stereo, ParallelRaysHaveNoPoint) {
    EXPECT_LT(stereo_point({0.1, 0.1, 0, 0}, StereoNoise{}).covariance.trace(), 0.0);
    EXPECT_LT(stereo_point({0.1, 0.2, 0, 0}, StereoNoise{}).covariance.trace(), 0.0);
    EXPECT_GT(stereo_point({0.2, 0.1, 0, 0}, StereoNoise{}).covariance.trace(), 0.0);
}

}  // namespace
}  // namespace stillmesh
