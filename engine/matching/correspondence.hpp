// A feature of the current frame together with the map point it was matched to: all that mesh, region and pose need,
// copied into one place so that they never touch the map. A measured point's covariance is kept in the two numbers it
// is made of (method.md 1): var_z along the ray r = (x/z, y/z, 1), and the pixel noise across it:
// Sigma = var_z r r^T + var_pixel z^2 diag(1, 1, 0).
#pragma once

#include <cstdint>

#include "engine/geometry/se3.hpp"

namespace stillmesh {

struct Correspondence {
    std::uint32_t feature = 0;             // index in the frame's features
    std::uint32_t point_slot = 0;          // in the map's pool
    double row = 0;                        // of the picture, -.5 the first, .5 the last
    Vector2 normalised = Vector2::Zero();  // undistorted (x/z, y/z)
    Vector3 p_camera = Vector3::Zero();    // measured, m; valid iff has_depth
    Vector3 p_world = Vector3::Zero();     // the map's estimate, m
    Vector3 p_anchor = Vector3::Zero();    // where the point was first seen, m
    double var_z = 0;                      // of the measured depth, m^2
    double var_pixel = 0;                  // of each normalised coordinate
    double map_var_z = 0;                  // of p_world along the ray, m^2
    double map_var_lateral = 0;            // of p_world across it, m^2
    double drift_var = 0;                  // of odometry since the point was last seen where it is, m^2: for verdicts
    double anchor_var_z = 0;               // of p_anchor, m^2
    double anchor_var_lateral = 0;
    double extent = 1;                // of the surface that it stands for, in squares of its distance
    double weight = 1;                // what the past says: 0 moves, 1 is known to stand still
    std::uint16_t distance_bits = 0;  // Hamming
    std::uint16_t stood_tenths = 0;   // s / 10 that its point has had a vote; at most kStoodMax
    bool has_depth = false;
    bool is_dynamic = false;  // lost its weight in earlier frames
    bool is_moving = false;   // by this frame: for statistics and pictures

    static constexpr double kStoodMax = 0xffff;
};

}  // namespace stillmesh
