// What local and global bundle adjustment are given and keep alike: observations, and of each point and keyframe.
#pragma once

#include <cstdint>

#include "engine/adjust/twin_pose.hpp"

namespace stillmesh {

struct AdjustmentObservation {
    std::uint32_t keyframe = 0;  // as add_keyframe() returned it
    std::uint32_t point = 0;     // as add_point() returned it
    double x = 0, y = 0;         // undistorted, normalised (x/z, y/z)
    double var_pixel = 0;        // of x and of y, > 0
    double z_m = 0;              // depth in the camera frame
    double var_z = 0;            // m^2; 0: no depth was measured
};

struct BundleKeyframe : TwinPose {
    std::uint32_t used = 0;  // observations that have a say
    bool is_fixed = false;
};

struct BundlePoint {
    double world[2][3] = {};  // current and candidate
    double factor[6] = {};    // Cholesky factor of the damped Hessian, by rows, its diagonal inverted
    double gradient[3] = {};
    double damping[3] = {};
    std::uint32_t begin = 0, end = 0;  // of its observations
    std::uint32_t given = 0;           // as many as there is room for
    bool is_used = false;              // it has enough of them
    bool can_move = false;             // in this iteration

    void place(const Vector3& at) noexcept {
        for (int k = 0; k < 3; ++k) world[0][k] = world[1][k] = at(k);
    }
};

// The least of the diagonal that damping scales: an unknown that nothing constrains stays where it is.
inline constexpr double kBundleDiagonalMin = 1e-6;
// A keyframe with fewer observations holds still: six unknowns, two residuals each.
inline constexpr std::uint32_t kKeyframeObservationsMin = 3;
// Per observation, in squared sigmas: a problem fitted this well is solved exactly.
inline constexpr double kBundleCostExact = 1e-20;

}  // namespace stillmesh
