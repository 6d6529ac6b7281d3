// What is in a map file, for people and other programs: the camera, where keyframes stand and who follows whom, the
// points and how sure they are, its depth images. Read by docs/SPEC-map.md, checksums and all; descriptors and features
// are passed over. Memory: the file, 80 bytes a point, 4 bytes a feature,
// 9.5 KiB a depth image. Any bytes are safe.
#pragma once

#include <cstdint>
#include <span>
#include <string>
#include <vector>

#include "engine/base/status.hpp"
#include "engine/outputs.hpp"
#include "engine/record/map_file.hpp"
#include "platform/evaluation/trajectory.hpp"

namespace stillmesh {

struct SavedKeyframe {
    TrajectoryPose pose;       // world from camera; on the map's clock
    std::uint64_t frame = 0;   // that it was made from
    std::uint32_t parent = 0;  // its place among the keyframes, from 1; 0: the root
    std::uint32_t features = 0;
    std::uint32_t points = 0;  // that it observes
};
struct SavedPoint {
    double x = 0, y = 0, z = 0;  // m, in the frame of the first camera: x right, y down, z forward
    double along_m2 = 0;         // variance of the place along the ray, and across it
    double across_m2 = 0;
    double static_weight = 0;     // Algorithm 2: 1 when new, up to 2 when proven
    std::uint32_t observers = 0;  // keyframes
    std::uint32_t seen = 0;       // frames that matched it
    bool is_moving = false;       // it has lost its weight
};
struct SavedDepth {
    std::uint64_t frame = 0;
    std::uint32_t keyframe = 0;  // that it hangs on: its place among them, from 1
    RigidTransform map_from_camera;
};
struct SavedMap {
    MapFileInfo info;
    CameraModel camera;  // of a lens other than Brown's only the numbers that Brown's has
    double readout_s = 0;
    std::vector<SavedKeyframe> keyframes;
    std::vector<SavedPoint> points;
    std::vector<std::uint32_t> shown;  // of each feature, keyframe by keyframe: its point, from 1; 0: none
    std::vector<SavedDepth> depth;
    std::vector<float> rays;  // of all depth images
    std::vector<std::uint16_t> depth_mm;

    // As Engine::depth_image(): without cells where there is none; borrowed from this.
    [[nodiscard]] DepthImage depth_image(std::size_t index) const;
};

// Pairs of keyframes that share at least so many points, by their frames; loops are not in a file. None of a map that
// no engine can hold: more than 1024 keyframes. Cost: that many pairs, and observers^2 for each point.
inline constexpr std::uint32_t kSharedUsual = 15;  // map.shared_min
[[nodiscard]] std::vector<KeyframeLink> covisible_keyframes(const SavedMap& map,
                                                            std::uint32_t shared_min = kSharedUsual);

// kUnavailable: cannot be read.    kInvalid: no map, or damaged: `message` says what.
[[nodiscard]] Status read_map_content(const std::string& file, SavedMap& content, std::string& message);
// For bytes in memory; `file` is only used in messages.
[[nodiscard]] Status parse_map_content(std::span<const std::byte> bytes, const std::string& file, SavedMap& content,
                                       std::string& message);

}  // namespace stillmesh
