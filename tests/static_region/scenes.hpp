// Rooms with bodies that moved in them, as correspondences with the pixels they were seen at: no pictures.
#pragma once

#include <algorithm>
#include <cmath>
#include <cstdint>
#include <vector>

#include "engine/features/features.hpp"
#include "engine/limits.hpp"
#include "engine/static_region/region_context.hpp"
#include "tests/support/synthetic.hpp"

namespace stillmesh::test {

inline constexpr double kFocal_px = 500, kCentreX = 320, kCentreY = 240;

inline Limits limits_of(std::uint32_t features, std::uint32_t groups = 64) {
    Limits limits;
    limits.features_max = features;
    limits.groups_max = groups;
    return limits;
}

// Correspondences with the pixels they were seen at.
struct Scene {
    std::vector<Correspondence> correspondences;
    std::vector<Keypoint> keypoints;
    std::vector<int> body;  // 0: the room

    void add(Correspondence c, int of_body) {
        Keypoint keypoint;
        keypoint.x = static_cast<float>(c.normalised.x() * kFocal_px + kCentreX);
        keypoint.y = static_cast<float>(c.normalised.y() * kFocal_px + kCentreY);
        c.feature = static_cast<std::uint32_t>(keypoints.size());
        c.point_slot = c.feature;
        correspondences.push_back(c);
        keypoints.push_back(keypoint);
        body.push_back(of_body);
    }
    [[nodiscard]] std::size_t count(int of_body) const {
        return static_cast<std::size_t>(std::count(body.begin(), body.end(), of_body));
    }
};

inline Vector3 at_pixel(double x, double y, double z) {
    return {(x - kCentreX) / kFocal_px * z, (y - kCentreY) / kFocal_px * z, z};
}

inline const Noise kKinect{0.8e-3, 1.425e-3, 0};

// The room behind, seen from `pose`, and a body before it, in a rectangle of the image, that moved by `motion` since.
inline Scene room_and_body(std::uint32_t room_points, std::uint32_t body_points, const SE3& pose, const SE3& motion,
                           Random& random) {
    Scene scene;
    while (scene.count(0) < room_points) {
        const double x = random.uniform(10, 630), y = random.uniform(10, 470);
        if (body_points > 0 && x > 210 && x < 410 && y > 110) continue;
        const Vector3 p = at_pixel(x, y, 2.6 + 0.001 * x + 0.05 * std::sin(0.02 * y));
        scene.add(measure(p, pose * p, kKinect, random), 0);
    }
    while (scene.count(1) < body_points) {
        const double x = random.uniform(220, 400), y = random.uniform(120, 470);
        const Vector3 p = at_pixel(x, y, 1.3 + 0.05 * std::sin(0.03 * x));
        scene.add(measure(p, motion * (pose * p), kKinect, random), 1);
    }
    return scene;
}

inline RegionContext context_at(const SE3& pose) {
    RegionContext context;
    context.world_from_camera_predicted = pose;
    context.prediction_sigma_m = 0.02;
    context.prediction_sigma_rad = 0.02;
    context.has_prediction = true;
    return context;
}

}  // namespace stillmesh::test
