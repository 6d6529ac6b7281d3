// Points in space and what a camera would measure of them, with known truth and known noise: no pictures.
#pragma once

#include <cmath>
#include <cstdint>
#include <vector>

#include "engine/base/random.hpp"
#include "engine/geometry/se3.hpp"
#include "engine/matching/correspondence.hpp"

namespace stillmesh::test {

struct Noise {
    double pixel = 0;    // deviation of a normalised coordinate
    double depth_m = 0;  // deviation of a depth at 1 m; grows with its square
    double map_m = 0;    // deviation of each coordinate of a map point
};

inline Vector3 random_vector(Random& random, double half) {
    Vector3 v;
    for (int i = 0; i < 3; ++i) v(i) = random.uniform(-half, half);
    return v;
}

inline Vector3 random_normal_vector(Random& random, double sigma) {
    Vector3 v;
    for (int i = 0; i < 3; ++i) v(i) = sigma * random.normal();
    return v;
}

inline SE3 random_motion(Random& random, double metres, double radians) {
    Vector6 xi;
    xi.head<3>() = random_vector(random, metres);
    xi.tail<3>() = random_vector(random, radians);
    return se3_exp(xi);
}

// A point in view of the camera, in its frame.
inline Vector3 random_point_in_view(Random& random, double z_min_m = 0.8, double z_max_m = 4.0) {
    const double z = random.uniform(z_min_m, z_max_m);
    const double x = random.uniform(-0.55, 0.55);
    const double y = random.uniform(-0.4, 0.4);
    return {x * z, y * z, z};
}

// What is measured of a point that truly is at `p_camera`, when the map believes it at `p_world`. The variances are
// those of the noise, or of small noise when there is none.
inline Correspondence measure(const Vector3& p_camera, const Vector3& p_world, const Noise& noise, Random& random) {
    const auto or_small = [](double sigma, double small) { return sigma > 0 ? sigma * sigma : small * small; };
    Correspondence c;
    const double z2 = p_camera.z() * p_camera.z();
    c.var_pixel = or_small(noise.pixel, 1e-3);
    c.var_z = or_small(noise.depth_m * z2, 2e-3);
    c.map_var_lateral = or_small(noise.map_m, 1e-4);
    c.map_var_z = c.map_var_lateral;
    const double dx = noise.pixel * random.normal();
    const double dy = noise.pixel * random.normal();
    c.normalised = Vector2(p_camera.x() / p_camera.z() + dx, p_camera.y() / p_camera.z() + dy);
    const double z = p_camera.z() + noise.depth_m * z2 * random.normal();
    c.p_camera = Vector3(c.normalised.x() * z, c.normalised.y() * z, z);
    c.p_world = p_world + random_normal_vector(random, noise.map_m);
    c.p_anchor = c.p_world;
    c.anchor_var_lateral = c.map_var_lateral;
    c.anchor_var_z = c.map_var_z;
    c.has_depth = true;
    return c;
}

// Many of them, seen by a camera at `world_from_camera`, all standing still.
inline std::vector<Correspondence> measure_scene(std::uint32_t count, const SE3& world_from_camera, const Noise& noise,
                                                 Random& random) {
    std::vector<Correspondence> out;
    for (std::uint32_t i = 0; i < count; ++i) {
        const Vector3 p = random_point_in_view(random);
        out.push_back(measure(p, world_from_camera * p, noise, random));
        out.back().feature = i;
        out.back().point_slot = i;
    }
    return out;
}

inline std::vector<std::uint16_t> all_of(const std::vector<Correspondence>& correspondences) {
    std::vector<std::uint16_t> out(correspondences.size());
    for (std::size_t i = 0; i < out.size(); ++i) out[i] = static_cast<std::uint16_t>(i);
    return out;
}

// How far apart two poses are: [m, rad].
inline double metres_between(const SE3& a, const SE3& b) {
    return (a.inverse() * b).translation.norm();
}
inline double radians_between(const SE3& a, const SE3& b) {
    return so3_log((a.inverse() * b).rotation).norm();
}

inline bool is_finite(const SE3& pose) {
    return pose.rotation.allFinite() && pose.translation.allFinite();
}

}  // namespace stillmesh::test
