#include "hal/simulated/renderer.hpp"

#include <gtest/gtest.h>

#include <cmath>

#include "engine/base/random.hpp"

namespace stillmesh::simulated::renderer_test {
namespace {

constexpr Pinhole kPinhole{96, 72, 80, 80, 47.5, 35.5};

// Promise: sine and arc tangent are good to 1e-9, in all quadrants.
TEST(Vector3, SineAndArcTangent) {
    for (int i = -4000; i <= 4000; ++i) {
        const double angle = i * 0.00731;
        EXPECT_NEAR(sine(angle), std::sin(angle), 1e-9);
        EXPECT_NEAR(cosine(angle), std::cos(angle), 1e-9);
        const double turn = std::remainder(angle, 2 * kPi);
        EXPECT_NEAR(std::remainder(arc_tangent2(std::sin(angle) * 3, std::cos(angle) * 3) - turn, 2 * kPi), 0, 1e-8);
    }
}

// Promise: each pixel shows the nearest face on its ray, at its true depth (brute force: every ray against every face).
TEST(Renderer, FindsTheNearestFace) {
    const Texture texture = paint(Pattern::kDark, 1);
    for (std::uint64_t seed = 1; seed <= 20; ++seed) {
        Random random(seed);
        const auto vector = [&](double s) {
            const double x = random.uniform(-s, s);
            const double y = random.uniform(-s, s);
            return Vec3{x, y, random.uniform(-s, s)};
        };
        Rigid pose = look_along(vector(0.5), {random.uniform(-0.3, 0.3), 1, random.uniform(-0.3, 0.3)});
        Renderer renderer(kPinhole);
        renderer.begin(pose, 0, 0);
        struct Face {
            Vec3 p[3];
        };
        std::vector<Face> faces;
        for (int i = 0; i < 25; ++i) {
            const Vec3 centre = Vec3{0, 3, 0} + vector(2);
            Vertex vertices[3];
            Face face;
            for (int k = 0; k < 3; ++k) {
                face.p[k] = centre + vector(1.5);  // some reach behind the camera
                vertices[k].p = face.p[k];
            }
            renderer.draw(vertices, 3, {&texture, Infrared::kGood, false});
            std::swap(vertices[1], vertices[2]);  // and its other side: exactly one is seen
            renderer.draw(vertices, 3, {&texture, Infrared::kGood, false});
            faces.push_back(face);
        }
        int wrong = 0;
        for (std::uint32_t y = 0; y < kPinhole.height; ++y) {
            for (std::uint32_t x = 0; x < kPinhole.width; ++x) {
                const Vec3 ray{(x - kPinhole.cx) / kPinhole.fx, (y - kPinhole.cy) / kPinhole.fy, 1};
                double nearest = 0;
                bool is_at_edge = false;
                for (const Face& face : faces) {
                    Vec3 p[3];
                    for (int k = 0; k < 3; ++k) p[k] = pose.rotation.transposed_times(face.p[k] - pose.translation);
                    const double det = dot(p[0], cross(p[1], p[2]));
                    const double b[3] = {dot(cross(p[1], p[2]), ray) / det, dot(cross(p[2], p[0]), ray) / det,
                                         dot(cross(p[0], p[1]), ray) / det};
                    const double w = b[0] + b[1] + b[2];
                    if (w <= 1e-6 || w > 1 / 0.081) continue;
                    const double least = std::min({b[0], b[1], b[2]}) / w;
                    is_at_edge |= std::abs(least) < 1e-3;
                    if (least >= 0) nearest = std::max(nearest, w);
                }
                const double found = static_cast<double>(renderer.inverse_depth()[y * kPinhole.width + x]);
                wrong += !is_at_edge && std::abs(found - nearest) > 1e-3 * nearest + 1e-6;
            }
        }
        // Where a face passes through the near plane the two differ by design.
        EXPECT_LE(wrong, 15) << seed;
    }
}

// Promise: a wall cut into triangles has neither gaps nor a pixel drawn by two of them.
TEST(Renderer, NeighboursLeaveNoGap) {
    const Texture texture = paint(Pattern::kDark, 1);
    Random random(3);
    Renderer renderer(kPinhole);
    renderer.begin(Rigid{}, 0.125, -0.375);
    constexpr int kSide = 9;
    Vec3 grid[kSide][kSide];
    for (int i = 0; i < kSide; ++i) {
        for (int j = 0; j < kSide; ++j) {
            const bool is_inner = i > 0 && j > 0 && i < kSide - 1 && j < kSide - 1;
            const double shift = is_inner ? random.uniform(-0.1, 0.1) : 0;
            grid[i][j] = {-2 + 0.5 * j + shift, -2 + 0.5 * i - shift, 2};
        }
    }
    for (int i = 0; i + 1 < kSide; ++i) {
        for (int j = 0; j + 1 < kSide; ++j) {
            Vertex v[4];
            v[0].p = grid[i][j];
            v[1].p = grid[i][j + 1];
            v[2].p = grid[i + 1][j + 1];
            v[3].p = grid[i + 1][j];
            renderer.draw(v, 3, {&texture, Infrared::kGood, false});
            const Vertex other[3] = {v[0], v[2], v[3]};
            renderer.draw(other, 3, {&texture, Infrared::kGood, false});
        }
    }
    for (const std::uint32_t id : renderer.face_ids()) ASSERT_NE(id, kNoFace);
    for (const float w : renderer.inverse_depth()) ASSERT_NEAR(w, 0.5F, 1e-5F);
}

// Promise: a texture lies where its coordinates say, seen from straight ahead at one texel a pixel.
TEST(Renderer, PutsTexelsInTheirPlace) {
    const Texture texture = paint(Pattern::kPoster, 5);
    Renderer renderer(kPinhole);
    renderer.begin(Rigid{}, 0, 0);
    Vertex v[4];
    for (int i = 0; i < 4; ++i) {
        const double x = i == 1 || i == 2 ? 200.5 : 100.5;  // pixel 0 lies at texel 100.5 + 0.5
        const double y = i >= 2 ? 180 : 80;
        v[i].u = static_cast<float>(x);
        v[i].v = static_cast<float>(y);
        v[i].p = {(x - 101 - kPinhole.cx) / kPinhole.fx * 2, (y - 80.5 - kPinhole.cy) / kPinhole.fy * 2, 2};
    }
    renderer.draw(v, 4, {&texture, Infrared::kGood, false});
    std::vector<float> sum(renderer.face_ids().size());
    renderer.shade_into(sum, 0.0F);
    for (std::uint32_t y = 2; y < 70; ++y) {
        for (std::uint32_t x = 2; x < 90; ++x) {
            const float expected = texture.pixels[(y + 80) * 512 + x + 100 - 0];
            const float other = texture.pixels[(y + 80) * 512 + x + 101];
            const float low = std::min(expected, other);
            const float high = std::max(expected, other);
            ASSERT_GE(sum[y * 96 + x], low - 3) << x << " " << y;
            ASSERT_LE(sum[y * 96 + x], high + 3) << x << " " << y;
        }
    }
}

}  // namespace
}  // namespace stillmesh::simulated::renderer_test
