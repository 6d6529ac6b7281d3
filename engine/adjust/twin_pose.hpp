// A keyframe's pose twice: the best so far and a candidate, told apart by an index that the adjustment flips when it
// accepts. With each, the rows that projecting a point needs.
#pragma once

#include <cstdint>

#include "engine/adjust/linearisation.hpp"
#include "engine/geometry/se3.hpp"

namespace stillmesh {

struct TwinPose {
    SE3 pose[2];  // world_from_camera
    CameraRows camera[2];

    void begin(const SE3& world_from_camera) noexcept {
        for (std::uint32_t i = 0; i < 2; ++i) set(i, world_from_camera);
    }
    // The candidate is where the camera is.
    void stay(std::uint32_t current) noexcept {
        pose[1 - current] = pose[current];
        camera[1 - current] = camera[current];
    }
    void move(std::uint32_t current, const Vector6& xi) noexcept {
        SE3 candidate = pose[current] * se3_exp(xi);
        renormalise(candidate.rotation);
        set(1 - current, candidate);
    }

private:
    void set(std::uint32_t which, const SE3& world_from_camera) noexcept {
        pose[which] = world_from_camera;
        camera[which] = camera_rows(world_from_camera);
    }
};

}  // namespace stillmesh
