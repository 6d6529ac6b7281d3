// The points that meshes are measured on: even random ones, and the features our extractor finds on frames.
#pragma once

#include <algorithm>
#include <vector>

#include "bench/features/frames.hpp"
#include "engine/base/random.hpp"
#include "engine/mesh/pixel_point.hpp"
#include "platform/linux/cpu_kernels.hpp"
#include "tests/features/rig.hpp"

namespace stillmesh::bench {

using Points = std::vector<PixelPoint>;

inline Points even_points(std::uint32_t count, std::uint64_t seed) {
    Random random(seed);
    Points points;
    for (std::uint32_t i = 0; i < count; ++i) {
        points.push_back({static_cast<std::int32_t>(random.below(640 * kMeshUnitsPerPixel)),
                          static_cast<std::int32_t>(random.below(480 * kMeshUnitsPerPixel))});
    }
    return points;
}

// A quarter of the points in each of four patches of texture, as on posters and people before a plain wall.
inline Points clustered_points(std::uint32_t count, std::uint64_t seed) {
    Random random(seed);
    Points points;
    for (std::uint32_t i = 0; i < count; ++i) {
        const double x = 100 + 140 * static_cast<double>(i % 4) + 20 * random.normal();
        const double y = 120 + 80 * static_cast<double>(i * 7 % 4) + 30 * random.normal();
        points.push_back({static_cast<std::int32_t>(std::clamp(x, 0.0, 639.0) * kMeshUnitsPerPixel),
                          static_cast<std::int32_t>(std::clamp(y, 0.0, 479.0) * kMeshUnitsPerPixel)});
    }
    return points;
}

// Up to 1000 features of each frame: of real recordings when STILLMESH_TEST_DATA names them, else of synthetic frames.
inline std::vector<Points> feature_points(std::size_t sets_max) {
    std::vector<cv::Mat> frames = real_frames(sets_max, 17);
    if (frames.empty()) frames = synthetic_frames(sets_max);
    testing::Rig rig(Limits::room(), cpu_kernels());
    std::vector<Points> sets;
    for (const cv::Mat& frame : frames) {
        if (rig.extractor.extract(view_of(frame), rig.features) != Status::kOk) continue;
        Points points;
        for (const Keypoint& keypoint : rig.features.keypoints.span()) {
            points.push_back({static_cast<std::int32_t>(keypoint.x * kMeshUnitsPerPixel + 0.5F),
                              static_cast<std::int32_t>(keypoint.y * kMeshUnitsPerPixel + 0.5F)});
        }
        sets.push_back(points);
    }
    return sets;
}

}  // namespace stillmesh::bench
