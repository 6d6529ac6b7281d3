// Points, rotations and rigid motions of the simulated world, in double: only + - * / sqrt, and sine and arc tangent
// made of these, so that a world has the same bits on every processor. (The engine's own are inside the engine, out of
// the reach of hal/. A scene may be 1e-9 off: what counts is that truth and pixels use the same numbers.)
#pragma once

#include <cmath>

#include "engine/base/numbers.hpp"

namespace stillmesh::simulated {

inline constexpr double kPi = 3.14159265358979323846;

struct Vec3 {
    double x = 0, y = 0, z = 0;

    constexpr Vec3 operator+(const Vec3& o) const noexcept { return {x + o.x, y + o.y, z + o.z}; }
    constexpr Vec3 operator-(const Vec3& o) const noexcept { return {x - o.x, y - o.y, z - o.z}; }
    constexpr Vec3 operator*(double s) const noexcept { return {x * s, y * s, z * s}; }
    constexpr Vec3 operator-() const noexcept { return {-x, -y, -z}; }
};

[[nodiscard]] constexpr double dot(const Vec3& a, const Vec3& b) noexcept {
    return a.x * b.x + a.y * b.y + a.z * b.z;
}
[[nodiscard]] constexpr Vec3 cross(const Vec3& a, const Vec3& b) noexcept {
    return {a.y * b.z - a.z * b.y, a.z * b.x - a.x * b.z, a.x * b.y - a.y * b.x};
}
[[nodiscard]] inline double length(const Vec3& a) noexcept {
    return std::sqrt(dot(a, a));
}
[[nodiscard]] inline Vec3 normalised(const Vec3& a) noexcept {
    const double l = length(a);
    return l > 0 ? a * (1.0 / l) : Vec3{1, 0, 0};
}
[[nodiscard]] constexpr Vec3 mix(const Vec3& a, const Vec3& b, double s) noexcept {
    return a + (b - a) * s;
}
[[nodiscard]] constexpr double mix(double a, double b, double s) noexcept {
    return a + (b - a) * s;
}
[[nodiscard]] constexpr double clamp01(double s) noexcept {
    return s < 0 ? 0 : (s > 1 ? 1 : s);
}
// 0 below 0, 1 above 1, with zero slope at both ends.
[[nodiscard]] constexpr double smooth_step(double s) noexcept {
    const double c = clamp01(s);
    return c * c * (3 - 2 * c);
}

// |angle| <= 1e6 rad; Taylor series on [-pi/4, pi/4], error below 1e-10.
[[nodiscard]] constexpr double sine(double angle_rad) noexcept {
    const auto quadrant = round_clamped_64(angle_rad * (2.0 / kPi));
    const double x = angle_rad - static_cast<double>(quadrant) * (kPi / 2.0);
    const double q = x * x;
    const double s = x * (1 - q / 6 * (1 - q / 20 * (1 - q / 42 * (1 - q / 72 * (1 - q / 110)))));
    const double c = 1 - q / 2 * (1 - q / 12 * (1 - q / 30 * (1 - q / 56 * (1 - q / 90))));
    switch (quadrant & 3) {
        case 0: return s;
        case 1: return c;
        case 2: return -s;
        default: return -c;
    }
}
[[nodiscard]] constexpr double cosine(double angle_rad) noexcept {
    return sine(angle_rad + kPi / 2.0);
}
// In [-pi, pi]. The angle is halved three times, then a series; error below 1e-9.
[[nodiscard]] inline double arc_tangent2(double y, double x) noexcept {
    const double r = std::sqrt(x * x + y * y);
    if (!(r > 0)) return 0;
    if (x < 0) {
        const double rest = arc_tangent2(y < 0 ? y : -y, -x);  // in [-pi/2, 0]
        return y < 0 ? -kPi - rest : kPi + rest;
    }
    double t = y / (r + x);  // tan of half the angle
    t = t / (1 + std::sqrt(1 + t * t));
    t = t / (1 + std::sqrt(1 + t * t));
    const double q = t * t;
    return 8 * t * (1 - q * (1.0 / 3 - q * (1.0 / 5 - q * (1.0 / 7 - q * (1.0 / 9 - q / 11)))));
}
[[nodiscard]] constexpr double radians(double degrees) noexcept {
    return degrees * (kPi / 180.0);
}

struct Mat3 {
    // Columns: where the three axes of the inner frame point.
    Vec3 a{1, 0, 0}, b{0, 1, 0}, c{0, 0, 1};

    constexpr Vec3 operator*(const Vec3& v) const noexcept { return a * v.x + b * v.y + c * v.z; }
    constexpr Mat3 operator*(const Mat3& o) const noexcept { return {*this * o.a, *this * o.b, *this * o.c}; }
    // The inverse rotation applied to v.
    [[nodiscard]] constexpr Vec3 transposed_times(const Vec3& v) const noexcept {
        return {dot(a, v), dot(b, v), dot(c, v)};
    }
};

[[nodiscard]] inline Mat3 rotation_x(double angle_rad) noexcept {
    const double s = sine(angle_rad);
    const double c = cosine(angle_rad);
    return {{1, 0, 0}, {0, c, s}, {0, -s, c}};
}
[[nodiscard]] inline Mat3 rotation_y(double angle_rad) noexcept {
    const double s = sine(angle_rad);
    const double c = cosine(angle_rad);
    return {{c, 0, -s}, {0, 1, 0}, {s, 0, c}};
}
[[nodiscard]] inline Mat3 rotation_z(double angle_rad) noexcept {
    const double s = sine(angle_rad);
    const double c = cosine(angle_rad);
    return {{c, s, 0}, {-s, c, 0}, {0, 0, 1}};
}

struct Rigid {
    Mat3 rotation;
    Vec3 translation;  // m

    constexpr Vec3 operator*(const Vec3& p) const noexcept { return rotation * p + translation; }
};

// world_from_camera of a camera (x right, y down, z forward) at `eye` that looks along `forward`, z of the world up.
[[nodiscard]] inline Rigid look_along(const Vec3& eye, const Vec3& forward) noexcept {
    const Vec3 f = normalised(forward);
    const Vec3 right = normalised(cross(f, {0, 0, 1}));
    return {{right, cross(f, right), f}, eye};
}

}  // namespace stillmesh::simulated
