#include "hal/simulated/row_renderer.hpp"

#include <gtest/gtest.h>

#include <algorithm>
#include <array>
#include <cmath>

#include "engine/base/random.hpp"
#include "hal/simulated/shading.hpp"

namespace stillmesh::simulated::row_renderer_test {
namespace {

constexpr Pinhole kPinhole{640, 480, 528, 528, 319.5, 239.5};

// Black to the left of its middle, white to the right.
Texture step_texture() {
    Texture out;
    constexpr std::int32_t kSide = 256;
    out.pixels.resize(kSide * kSide);
    for (std::size_t i = 0; i < out.pixels.size(); ++i) out.pixels[i] = i % kSide < kSide / 2 ? 0 : 200;
    out.levels[0] = {out.pixels.data(), kSide, kSide - 1, kSide - 1, 1.0F};
    out.level_count = 1;
    out.width = out.height = kSide;
    return out;
}

// Across the view at depth z, its middle at x; `half` to the sides. Once the texture.
std::array<Vertex, 4> wall(double x, double z, double half) {
    std::array<Vertex, 4> v;
    for (std::size_t i = 0; i < 4; ++i) {
        const bool is_right = i == 1 || i == 2;
        v[i].p = {x + (is_right ? half : -half), i >= 2 ? half : -half, z};
        v[i].u = is_right ? 256.0F : 0.0F;
        v[i].v = i >= 2 ? 256.0F : 0.0F;
    }
    return v;
}

// Where the row goes from black to white, px.
double edge_of(const std::vector<float>& grey, std::uint32_t y) {
    const float* const row = grey.data() + std::size_t{y} * kPinhole.width;
    for (std::uint32_t x = 1; x < kPinhole.width; ++x) {
        if (row[x] >= 100 && row[x - 1] < 100 && row[x - 1] >= 0.0F) {
            return x - 1 + static_cast<double>((100 - row[x - 1]) / (row[x] - row[x - 1]));
        }
    }
    return -1;
}

constexpr double kReadoutS = 0.028;
double row_time(std::uint32_t y) {
    return ((y + 0.5) / kPinhole.height - 0.5) * kReadoutS;
}

// Promise: read at one moment, a picture is the renderer's, whatever lies about, behind and through the camera.
TEST(RowRenderer, AtOneMomentIsTheRenderer) {
    const Texture texture = paint(Pattern::kPoster, 1);
    for (std::uint64_t seed = 1; seed <= 10; ++seed) {
        Random random(seed);
        const auto vector = [&](double s) {
            const double x = random.uniform(-s, s);
            const double y = random.uniform(-s, s);
            return Vec3{x, y, random.uniform(-s, s)};
        };
        const Rigid pose = look_along(vector(0.5), {random.uniform(-0.3, 0.3), 1, random.uniform(-0.3, 0.3)});
        std::vector<std::array<Vertex, 3>> faces(40);
        for (auto& face : faces) {
            const Vec3 centre = Vec3{0, 3, 0} + vector(2);
            for (Vertex& v : face) {
                v.p = centre + vector(1.5);
                v.u = static_cast<float>(random.uniform(0, 500));
                v.v = static_cast<float>(random.uniform(0, 500));
            }
        }
        Renderer renderer(kPinhole);
        renderer.begin(pose, 0.125, -0.25);
        Recording recording;
        recording.begin(-0.01, 0.01);
        for (std::uint32_t i = 0; i < recording.count(); ++i) {
            recording.begin_pass(i);
            for (std::size_t k = 0; k < 20; ++k) recording.draw(faces[k].data(), 3, {&texture});
        }
        recording.begin_still();
        for (std::size_t k = 20; k < 40; ++k) recording.draw(faces[k].data(), 3, {&texture});
        for (const auto& face : faces) renderer.draw(face.data(), 3, {&texture});
        RowRenderer rows(kPinhole);
        rows.draw(recording, std::vector<RowPose>(kPinhole.height, {pose, 0.003}), 0.125, -0.25);
        std::vector<float> grey(renderer.face_ids().size()), grey_of_rows(grey.size());
        renderer.shade_into(grey, 0.25F);
        rows.shade_into(grey_of_rows, 0.25F);
        std::size_t other_depth = 0;
        std::size_t other_grey = 0;
        for (std::size_t i = 0; i < grey.size(); ++i) {
            const float w = renderer.inverse_depth()[i];
            other_depth += std::abs(rows.inverse_depth()[i] - w) > 1e-5F * w + 1e-6F;
            other_grey += std::abs(grey[i] - grey_of_rows[i]) > 2;
        }
        // Where two faces cut each other, and where one comes too near, either may be taken.
        EXPECT_LT(other_depth, 100U) << seed;
        EXPECT_LT(other_grey, 400U) << seed;
        EXPECT_EQ(rows.face(0).material.texture, &texture);
    }
}

// Promise: while the camera turns, every row shows an edge where theory has it at the row's time, to a tenth of a
// pixel, and without steps from row to row.
TEST(RowRenderer, AnEdgeLeansAsTheCameraTurns) {
    const Texture texture = step_texture();
    RowRenderer rows(kPinhole);
    for (const double degrees_s : {-30.0, 30.0, 90.0}) {
        Recording recording;
        recording.begin(-0.02, 0.02);
        recording.begin_still();
        recording.draw(wall(0.1, 2, 3).data(), 4, {&texture});
        std::vector<RowPose> poses(kPinhole.height);
        for (std::uint32_t y = 0; y < kPinhole.height; ++y) {
            poses[y] = {{rotation_y(radians(degrees_s) * row_time(y)), {}}, row_time(y)};
        }
        rows.draw(recording, poses, 0, 0);
        std::vector<float> grey(rows.face_ids().size());
        rows.shade_into(grey, 0);
        double last = 0;
        for (std::uint32_t y = 0; y < kPinhole.height; ++y) {
            const double angle = std::atan2(0.1, 2) - degrees_s * kPi / 180 * row_time(y);
            const double expected = kPinhole.fx * std::tan(angle) + kPinhole.cx;
            const double found = edge_of(grey, y);
            ASSERT_NEAR(found, expected, 0.1) << degrees_s << " row " << y;
            if (y > 0) {
                const double by_row = -degrees_s * kPi / 180 * kPinhole.fx * kReadoutS / kPinhole.height;
                ASSERT_NEAR(found - last, by_row, 0.02) << degrees_s << " row " << y;
            }
            last = found;
        }
    }
}

// Promise: what moves is in each row where it is at the row's time: an edge that walks by, its depth likewise.
TEST(RowRenderer, WhatMovesLeans) {
    const Texture texture = step_texture();
    RowRenderer rows(kPinhole);
    constexpr double kSpeed = 1.4;  // m/s
    Recording recording;
    recording.begin(-0.015, 0.015);
    for (std::uint32_t i = 0; i < recording.count(); ++i) {
        recording.begin_pass(i);
        recording.draw(wall(kSpeed * recording.moment_s(i), 2, 0.8).data(), 4, {&texture, Infrared::kGood, true});
    }
    std::vector<RowPose> poses(kPinhole.height);
    for (std::uint32_t y = 0; y < kPinhole.height; ++y) poses[y] = {{}, row_time(y)};
    rows.draw(recording, poses, 0, 0);
    std::vector<float> grey(rows.face_ids().size());
    rows.shade_into(grey, 0);
    for (std::uint32_t y = 40; y < 440; ++y) {
        const double x = kSpeed * row_time(y);
        const auto* const ids = rows.face_ids().data() + std::size_t{y} * kPinhole.width;
        const auto first = std::find_if(ids, ids + kPinhole.width, [](std::uint32_t id) { return id != kNoFace; });
        ASSERT_EQ(first - ids, static_cast<std::ptrdiff_t>(std::ceil((x - 0.8) / 2 * kPinhole.fx + kPinhole.cx))) << y;
        // At the wall's end its texture begins anew: look from there on.
        std::fill_n(grey.begin() + static_cast<std::ptrdiff_t>(std::size_t{y} * kPinhole.width), first - ids + 8, 0.0F);
        ASSERT_NEAR(edge_of(grey, y), x / 2 * kPinhole.fx + kPinhole.cx, 0.1) << y;
    }
}

// Promise: a recording goes straight between its moments, and stays at its ends.
TEST(Recording, IsStraightInBetween) {
    Recording recording;
    recording.begin(1.0, 1.02);
    ASSERT_GE(recording.count(), 4U);
    EXPECT_DOUBLE_EQ(recording.moment_s(recording.count() - 1), 1.02);
    const Texture texture = step_texture();
    for (std::uint32_t i = 0; i < recording.count(); ++i) {
        recording.begin_pass(i);
        recording.draw(wall(recording.moment_s(i), 2, 1).data(), 4, {&texture});
    }
    const Recording::Face& face = recording.faces().at(0);
    EXPECT_TRUE(face.moves);
    for (const double t : {1.0, 1.0031, 1.017, 1.02}) {
        EXPECT_NEAR(recording.corner(face, 1, recording.at(t)).x, t + 1, 1e-12);
    }
    EXPECT_NEAR(recording.corner(face, 1, recording.at(0.9)).x, 2.0, 1e-12);
    EXPECT_NEAR(recording.corner(face, 1, recording.at(1.1)).x, 2.02, 1e-12);
}

// Promise: a run of no face is the grey of nothing, added.
TEST(Shading, NothingIsDark) {
    float out[4] = {1, 1, 1, 1};
    const float depth[4] = {};
    shade_run(nullptr, {1, 3, 0}, 0, depth, out);
    EXPECT_EQ(out[0], 1.0F);
    EXPECT_EQ(out[1], 21.0F);
    EXPECT_EQ(out[2], 21.0F);
    EXPECT_EQ(out[3], 1.0F);
}

}  // namespace
}  // namespace stillmesh::simulated::row_renderer_test
