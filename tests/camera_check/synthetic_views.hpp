// Matches between two views of points, without pictures: a camera that turns and moves in a room of points, some of
// which may go with somebody, seen with noise.
#pragma once

#include <array>
#include <cmath>
#include <cstdint>
#include <vector>

#include "engine/base/random.hpp"
#include "platform/camera_check/views.hpp"

namespace stillmesh::test {

struct ViewPair {
    std::array<double, 3> turn{};  // rad, about x, y, z one after the other
    std::array<double, 3> way{};   // m
};

inline CameraModel usual_camera() {
    CameraModel m;
    m.width = 640;
    m.height = 480;
    m.fx = m.fy = 528;
    m.cx = 319.5;
    m.cy = 239.5;
    return m;
}

// Seen by `real`, taken for `given`; depth read `factor` times too large.
inline std::vector<ViewMatch> seen(const ViewPair& pair, const CameraModel& real, const CameraModel& given,
                                   double factor, std::uint64_t seed, std::size_t count = 150) {
    Random random(seed);
    std::vector<ViewMatch> matches;
    const auto feature = [&](double x, double y, double z) {
        ViewFeature f;
        f.u = static_cast<float>(real.fx * x / z + real.cx + 0.7 * random.normal());
        f.v = static_cast<float>(real.fy * y / z + real.cy + 0.7 * random.normal());
        f.x = static_cast<float>((f.u - given.cx) / given.fx);
        f.y = static_cast<float>((f.v - given.cy) / given.fy);
        f.inverse_depth = static_cast<float>((1 / z + 1e-3 * random.normal()) / factor);
        return f;
    };
    while (matches.size() < count) {
        const double z = random.uniform(0.8, 4.0);
        double p[3] = {(random.uniform(0, 640) - real.cx) / real.fx * z,
                       (random.uniform(0, 480) - real.cy) / real.fy * z, z};
        double q[3] = {p[0], p[1], p[2]};
        for (int axis = 0; axis < 3; ++axis) {
            const double c = std::cos(pair.turn[static_cast<std::size_t>(axis)]);
            const double s = std::sin(pair.turn[static_cast<std::size_t>(axis)]);
            const int i = (axis + 1) % 3, k = (axis + 2) % 3;
            const double a = q[i], b = q[k];
            q[i] = c * a - s * b;
            q[k] = s * a + c * b;
        }
        for (int axis = 0; axis < 3; ++axis) q[axis] += pair.way[static_cast<std::size_t>(axis)];
        if (q[2] < 0.3) continue;
        const ViewMatch match = {feature(p[0], p[1], p[2]), feature(q[0], q[1], q[2])};
        if (match.b.u < 0 || match.b.u > 639 || match.b.v < 0 || match.b.v > 479) continue;
        matches.push_back(match);
    }
    return matches;
}

// Left, right, up, down, as one looks around: five degrees each, and a hand's breadth.
inline std::vector<ViewPair> looking_around(std::uint64_t seed) {
    Random random(seed);
    std::vector<ViewPair> pairs;
    for (int i = 0; i < 8; ++i) {
        ViewPair pair;
        const double sign = i % 4 < 2 ? 1.0 : -1.0;
        pair.turn = {i % 2 == 0 ? 0.01 * random.normal() : 0.09 * sign,
                     i % 2 == 0 ? 0.09 * sign : 0.01 * random.normal(), 0.03 * random.normal()};
        pair.way = {0.05 * random.normal(), 0.05 * random.normal(), 0.05 * random.normal()};
        pairs.push_back(pair);
    }
    return pairs;
}

}  // namespace stillmesh::test
