// By how much the camera turned between its picture and its depth image. Few cameras take both at once: depth comes up
// to 25 ms late, of which stamps tell a part. A camera that turns at 100 degrees per second has turned by 2.5 degrees
// then, 22 px, and what is read at a feature is the depth of a place beside it. So that turn is an unknown of the frame
// beside its pose, three numbers with a prior: rays say where the camera looks, depth says where it looked. Cost: three
// passes over at most 128 matches, with six looks into the depth image each.
#pragma once

#include <cstdint>
#include <span>

#include "engine/base/status.hpp"
#include "engine/features/features.hpp"
#include "engine/frame/frame.hpp"
#include "engine/geometry/camera.hpp"
#include "engine/geometry/depth_noise.hpp"
#include "engine/matching/correspondence.hpp"

namespace stillmesh {

// Where depth is looked up: a frame with depth, the colour camera that it is registered to, and the features of the
// picture. All of it outlives this.
struct DepthPicture {
    const Frame* frame = nullptr;
    const CameraModel* camera = nullptr;
    const DepthParameters* range = nullptr;
    std::span<const Keypoint> keypoints;
};

// Depth of what the camera sees in a pixel along `ray` (normalised coordinates), m along its axis, from a depth image
// that was taken when it had turned by `turn` (rad, in its own frame).
[[nodiscard]] DepthSample depth_behind(const DepthPicture& picture, const Vector2& pixel, const Vector2& ray,
                                       const Vector3& turn) noexcept;

// What is known beforehand: about where the camera is, with which turn the correspondences' depth was looked up, which
// one is expected, and its deviation about that, rad. What depth is off by is shared by whole surfaces (scale, bending,
// noise that lasts), so that matches say less than their number: `trust` of it.
struct DepthTurnPrior {
    SE3 world_from_camera;
    Vector3 looked_up = Vector3::Zero();
    Vector3 expected = Vector3::Zero();
    double sigma_rad = 0;
    double trust = 1;
};

// The most likely turn. kInvalid: a singular system.
[[nodiscard]] Result<Vector3> measure_depth_turn(std::span<const Correspondence> correspondences,
                                                 std::span<const std::uint16_t> chosen, const DepthPicture& picture,
                                                 const DepthTurnPrior& prior, double chi2_max) noexcept;

}  // namespace stillmesh
