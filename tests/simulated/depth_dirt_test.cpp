#include "hal/simulated/depth_dirt.hpp"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>

#include "hal/simulated/shadows.hpp"

namespace stillmesh::simulated::depth_dirt_test {
namespace {

constexpr Pinhole kPinhole{320, 240, 264, 264, 159.5, 119.5};
constexpr std::size_t kPixels = std::size_t{320} * 240;

Dirt only(double Dirt::*effect, double strength = 1) {
    Dirt dirt = all_dirt(0);
    dirt.*effect = strength;
    return dirt;
}

// A wall across the view at depth z, and before its right half, when near_z > 0, another.
struct Wall {
    explicit Wall(double z, double near_z = 0) : texture(paint(Pattern::kDark, 1)), renderer(kPinhole) {
        renderer.begin(Rigid{}, 0, 0);
        add(z, -2);
        if (near_z > 0) add(near_z, 0);
    }
    void add(double z, double from) {
        Vertex v[4];
        v[0].p = {from * z, -2 * z, z};
        v[1].p = {2 * z, -2 * z, z};
        v[2].p = {2 * z, 2 * z, z};
        v[3].p = {from * z, 2 * z, z};
        renderer.draw(v, 4, {&texture});
    }
    [[nodiscard]] std::vector<double> sense(std::uint64_t seed, const DepthErrors& errors) const {
        std::vector<std::uint16_t> depth;
        DepthSensor(kPinhole.width, kPinhole.height).sense(renderer, seed, 5000.0F, depth, errors);
        std::vector<double> out;
        for (const std::uint16_t d : depth) out.push_back(d / 5000.0);
        return out;
    }
    Texture texture;
    Renderer renderer;
};

// Promise: without dirt the depth camera is the colour camera, in time, and has nothing to add.
TEST(DepthDirt, CleanIsClean) {
    DepthDirt clean(all_dirt(0), 1, kPinhole);
    EXPECT_EQ(clean.pinhole().fx, kPinhole.fx);
    EXPECT_EQ(clean.place().rotation.a.x, 1.0);
    EXPECT_EQ(clean.place().translation.x, 0.0);
    EXPECT_EQ(clean.late_s(3), 0.0);
    const DepthErrors errors = clean.errors(0, std::vector<float>(kPixels, 10));
    const Wall wall(2);
    EXPECT_EQ(wall.sense(3, errors), wall.sense(3, {}));
}

// Promise: a depth camera beside the colour camera sees things .3 to 3 px (at VGA: 1 to 3) from where colour does.
TEST(DepthDirt, BordersLieApart) {
    for (std::uint64_t seed = 1; seed <= 8; ++seed) {
        const DepthDirt depth(only(&Dirt::borders), seed, kPinhole);
        EXPECT_NEAR(std::abs(depth.pinhole().fx / kPinhole.fx - 1), 0.005, 1e-9);
        const Rigid& place = depth.place();
        EXPECT_NEAR(std::abs(place.translation.x), 0.002, 1e-9);
        EXPECT_NEAR(std::acos(place.rotation.c.z), radians(0.2), 1e-5);
        for (const Vec3& p : {Vec3{0, 0, 1}, Vec3{0.4, 0.2, 2}, Vec3{-0.8, 0.5, 3}}) {
            const Vec3 q = place.rotation.transposed_times(p - place.translation);
            const double dx = depth.pinhole().fx * q.x / q.z - kPinhole.fx * p.x / p.z;
            const double dy = depth.pinhole().fy * q.y / q.z - kPinhole.fy * p.y / p.z;
            const double apart = 2 * std::sqrt(dx * dx + dy * dy);
            EXPECT_GT(apart, 0.3) << seed;
            EXPECT_LT(apart, 4) << seed;
        }
    }
}

// Promise: depth is late by 0 to 25 ms, and that changes slowly.
TEST(DepthDirt, ComesLate) {
    const DepthDirt depth(only(&Dirt::late), 3, kPinhole);
    double least = 1;
    double most = 0;
    for (int i = 0; i < 600; ++i) {
        const double late = depth.late_s(i / 30.0);
        least = std::min(least, late);
        most = std::max(most, late);
        EXPECT_LT(std::abs(depth.late_s((i + 1) / 30.0) - late), 0.0005);
    }
    EXPECT_NEAR(least, 0, 1e-4);
    EXPECT_NEAR(most, 0.025, 1e-4);
}

// Promise: depth is up to 1.5 % off in a pattern that stays and has no steps, and all of it drifts by .4 %.
TEST(DepthDirt, ScaleIsAPattern) {
    DepthDirt depth(only(&Dirt::scale), 5, kPinhole);
    const std::vector<float> grey(kPixels, 100);
    const DepthErrors errors = depth.errors(0, grey);
    std::vector<double> first(kPixels);
    double most = 0;
    for (std::size_t i = 0; i < kPixels; ++i) {
        first[i] = 1 / static_cast<double>(errors.nearness[i]) - 1;
        most = std::max(most, std::abs(first[i]));
        if (i % 320 != 0) {
            ASSERT_LT(std::abs(first[i] - first[i - 1]), 0.0004);
        }
    }
    EXPECT_LT(most, 0.0195);
    EXPECT_GT(most, 0.0105);
    double drift = 0;
    for (int t = 0; t < 40; ++t) {
        const DepthErrors now = depth.errors(t, grey);
        const double change = 1 / static_cast<double>(now.nearness[0]) - 1 - first[0];
        for (const std::size_t i : {5'000U, 40'000U, 70'000U}) {
            EXPECT_NEAR(1 / static_cast<double>(now.nearness[i]) - 1 - first[i], change, 0.0002);
        }
        drift = std::max(drift, std::abs(change));
    }
    EXPECT_GT(drift, 0.0035);
    EXPECT_LT(drift, 0.0085);
}

// Promise: what is dark in the picture measures .9 % too far, what is bright does not.
TEST(DepthDirt, DarkIsFarther) {
    DepthDirt depth(only(&Dirt::dark), 5, kPinhole);
    std::vector<float> grey(kPixels, 150);
    for (std::size_t i = 0; i < kPixels / 2; ++i) grey[i] = 15;
    const DepthErrors errors = depth.errors(0, grey);
    EXPECT_NEAR(errors.nearness[20 * 320 + 50], 1 / 1.009, 1e-6);
    EXPECT_EQ(errors.nearness[200 * 320 + 50], 1.0F);
}

// Promise: noise is one and a half times the clean sensor's; a good half of it is still there a tenth of a second
// later, nothing of it after two.
TEST(DepthDirt, NoiseStays) {
    DepthDirt depth(only(&Dirt::noise), 7, kPinhole);
    const std::vector<float> grey(kPixels, 100);
    constexpr double kZ = 2.0;
    const Wall wall(kZ);
    const auto at = [&](double time_s, std::uint64_t seed) { return wall.sense(seed, depth.errors(time_s, grey)); };
    const std::vector<double> now = at(1.0, 1);
    const std::vector<double> soon = at(1.1, 2);
    const std::vector<double> later = at(3.0, 3);
    double variance = 0;
    double with_soon = 0;
    double with_later = 0;
    double count = 0;
    for (std::size_t i = 0; i < kPixels; ++i) {
        if (now[i] == 0 || soon[i] == 0 || later[i] == 0) continue;
        variance += (now[i] - kZ) * (now[i] - kZ);
        with_soon += (now[i] - kZ) * (soon[i] - kZ);
        with_later += (now[i] - kZ) * (later[i] - kZ);
        ++count;
    }
    EXPECT_NEAR(std::sqrt(variance / count) / (1.425e-3 * kZ * kZ), 1.5, 0.25);
    EXPECT_GT(with_soon / variance, 0.35);
    EXPECT_LT(with_soon / variance, 0.65);
    EXPECT_NEAR(with_later / variance, 0, 0.12);
}

// Promise: along a border some pixels measure between near and far, which a clean sensor never does.
TEST(DepthDirt, BordersHavePixelsBetween) {
    const Wall wall(3.0, 1.5);
    DepthDirt depth(only(&Dirt::ragged), 7, kPinhole);
    const auto between = [&](const DepthErrors& errors) {
        const std::vector<double> z = wall.sense(1, errors);
        return std::count_if(z.begin(), z.end(), [](double d) { return d > 1.6 && d < 2.8; });
    };
    EXPECT_EQ(between({}), 0);
    const auto found = between(depth.errors(0, std::vector<float>(kPixels, 100)));
    EXPECT_GT(found, 60);
    EXPECT_LT(found, 800);
}

// Promise: a point behind someone, seen from the lamps, is darker, softly so; far away nothing changes.
TEST(Shadows, FallBehindPeople) {
    const Post post{{0, 0, 0}, 1.75};
    EXPECT_EQ(light_left({}, {0.1, 0.2, 0}, 1), 1.0);
    EXPECT_EQ(light_left({&post, 1}, {2.5, 2.2, 0}, 0), 1.0);
    EXPECT_LT(light_left({&post, 1}, {0.5, 0.4, 0}, 1), 0.9);  // two lamps stand behind him
    EXPECT_EQ(light_left({&post, 1}, {0.0, 2.4, 1.9}, 1), 1.0);
    double last = light_left({&post, 1}, {-3, 0.4, 0}, 1);
    for (int i = 1; i < 600; ++i) {
        const double now = light_left({&post, 1}, {-3 + i * 0.01, 0.4, 0}, 1);
        EXPECT_LT(std::abs(now - last), 0.03) << i;
        EXPECT_GT(now, 0.5);
        last = now;
    }
}

}  // namespace
}  // namespace stillmesh::simulated::depth_dirt_test
