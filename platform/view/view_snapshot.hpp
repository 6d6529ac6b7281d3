// What a page that looks on is shown of one frame: plain data of bounded size, filled by the engine's thread, turned
// into a message by another. Memory: some 290 KB, taken once (reserve).
#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <vector>

#include "engine/outputs.hpp"

namespace stillmesh {

inline constexpr std::uint32_t kViewWidthMax = 320;  // px, of the picture
inline constexpr std::uint32_t kViewPixelsMax = 320 * 320;
inline constexpr std::size_t kViewFeaturesMax = 2000;  // what is beyond is not shown
inline constexpr std::size_t kViewEdgesMax = 3 * kViewFeaturesMax;
inline constexpr std::size_t kViewKeyframesMax = 1024;  // as many as an engine may have
inline constexpr std::size_t kViewLinksOfEach = 3;      // of covisible keyframes: more are a tangle
inline constexpr std::size_t kViewLinksMax = kViewLinksOfEach * kViewKeyframesMax + kLoopLinksMax;
inline constexpr float kViewStepsPerPixel = 8;  // of ShownEdge and ShownFeature

struct ShownEdge {
    std::int16_t x0, y0, x1, y1;  // 1/8 px of the camera's image
};
struct ShownFeature {
    // What became of it, and beside that the motions that explain it.
    enum Kind : std::int16_t { kNeither = 0, kStatic = 1, kMoving = 2, kByChoice = 4, kByRival = 8 };
    std::int16_t x, y;   // 1/8 px of the camera's image
    std::int16_t group;  // of the mesh; -1: in none
    std::int16_t kind;   // and what explains it
};

struct ViewSnapshot {
    std::uint64_t frame = 0;
    std::int64_t time_ns = 0;
    std::size_t map = 1;
    PoseState state = PoseState::kNone;
    const char* reason = "none";  // why it is not `tracked`; of static life
    RigidTransform map_from_camera;
    std::uint32_t image_width = 0, image_height = 0;      // px, of the camera
    std::uint32_t picture_width = 0, picture_height = 0;  // px, of `grey`
    std::vector<std::uint8_t> grey;
    std::vector<ShownEdge> kept, cut;
    std::vector<ShownFeature> features;
    std::vector<KeyframePose> keyframes;
    std::vector<KeyframeLink> links;  // between them
    FrameStatistics statistics;
    std::array<float, kStages> stage_ms{};
    float frame_ms = 0;   // frame in to pose out
    float budget_ms = 0;  // until the next frame of the camera; 0: unknown
    PoolStatistics keyframe_pool, point_pool, queue_pool;
    std::uint32_t features_max = 0;

    void reserve() {
        grey.reserve(kViewPixelsMax);
        kept.reserve(kViewEdgesMax);
        cut.reserve(kViewEdgesMax);
        features.reserve(kViewFeaturesMax);
        keyframes.reserve(kViewKeyframesMax);
        links.reserve(kViewLinksMax);
    }
};

// A place on the path, in the map.
inline constexpr float kViewPlaceGap = 8;
struct ViewPlace {
    float x = 0, y = 0, z = 0;  // m
    float state = 0;  // a PoseState; kViewPlaceGap more: between the place before and this one nothing is known
};

// What a keyframe saw to stand still: in the frame of its own camera, so that it follows when the map is corrected.
struct ViewCloud {
    static constexpr std::size_t kPointsMax = 200;
    struct Point {
        std::int16_t x, y, z;  // mm
        std::int16_t grey;
    };
    std::uint64_t keyframe = kNoKeyframe;
    std::uint32_t count = 0;
    std::array<Point, kPointsMax> points{};
};

}  // namespace stillmesh
