// From the engine's frames to those of a robot's body, as ROS has them (REP 103, REP 105). The engine moves an optical
// frame (x right, y down, z forward); ROS moves base_link (x forward, y left, z up), and odom and map lie where
// base_link was at the first frame. With B = base_from_optical each pose T of the engine becomes B T B^-1. Covariances:
// the engine's is of xi = [translation m, rotation rad] in pose * exp(xi), in the camera's frame; ROS's is of x, y, z
// and rotations about fixed axes, of a pose in the axes of its parent frame, of a twist in those of the child. Plain
// functions, no heap; some 3 us a covariance.
#pragma once

#include <array>
#include <string>
#include <string_view>

#include "engine/outputs.hpp"
#include "platform/poses/velocity.hpp"

namespace stillmesh {

using Covariance6 = std::array<double, 36>;  // row by row

// What a number is said to vary by where nothing is known of it, m^2 or rad^2.
inline constexpr double kUnknownVariance = 1e6;

// An optical frame (x right, y down, z forward) in a body's (x forward, y left, z up) that looks the same way.
inline constexpr RigidTransform kLinkFromOptical = {{-0.5, 0.5, -0.5, 0.5}, {0, 0, 0}};

class BodyFrames {
public:
    BodyFrames() : BodyFrames(RigidTransform{}) {}
    explicit BodyFrames(const RigidTransform& base_from_camera_link);

    // Takes a pose between optical frames to that between the bodies that carry them.
    [[nodiscard]] RigidTransform of_base(const RigidTransform& of_camera) const;
    // A point of the engine's map in ROS's.
    [[nodiscard]] std::array<double, 3> point(const double (&in_map)[3]) const;
    // A covariance in the camera's frame as one in base_link's.
    [[nodiscard]] Covariance6 of_base(const double (&of_camera)[36]) const;
    // Velocity of the camera, in its frame, as that of base_link in its own.
    [[nodiscard]] Velocity of_base(const Velocity& of_camera) const;

private:
    RigidTransform base_from_optical_, optical_from_base_;
};

// A covariance in the child's axes, as one of the same pose in its parent's.
[[nodiscard]] Covariance6 in_parent(const Covariance6& in_child, const RigidTransform& parent_from_child);
// The engine's covariance knows nothing of another explanation, nor of what happened since nothing was measured:
//   tracked    as it is
//   unsure     and .1 m, .1 rad
//   predicted  the last one measured, and .1 m and .5 m/s, .1 rad and .5 rad/s since then
// What is not finite is not known: then all of it is kUnknownVariance, without correlations.
[[nodiscard]] Covariance6 with_doubt(const Covariance6& measured, PoseState state, double seconds_unmeasured);

// "x,y,z" or "x,y,z,qx,qy,qz,qw": m, and a quaternion of any length but 0. False: it is neither.
[[nodiscard]] bool parse_pose(std::string_view text, RigidTransform& pose);

}  // namespace stillmesh
