// What something beside the camera says of how the camera moved: wheels, a gyroscope, a visual-inertial odometry. It is
// evidence among others: it may be wrong for a while, and its deviations too small. Plain data.
#pragma once

#include "engine/outputs.hpp"

namespace stillmesh {

// From the last frame that submit() took to this one. The deviations are of each axis over this interval; those of
// frames in a row are added up, not their squares, since what wheels and gyroscopes are off by is mostly a scale or a
// bias that stays. Wheels and a gyroscope together: the translation of one, the rotation of the other.
struct MotionHint {
    RigidTransform last_from_camera;  // of the camera now, seen from the camera then
    double sigma_m = -1;              // negative: nothing is said of the translation
    double sigma_rad = -1;            // negative: nothing is said of the rotation
};

}  // namespace stillmesh
