// Transforms as they lie in a bag: /tf_static, /tf for what was sent there as well, and what RealSense's own recordings
// say beside each stream. Any bytes are safe.
#pragma once

#include <optional>
#include <span>
#include <string_view>

#include "hal/bag/ros_messages.hpp"
#include "hal/calibration/frame_tree.hpp"

namespace stillmesh {

// A message of kTransformsType, kOldTransformsType or kTransformType; others are passed over. `topic` tells a RealSense
// stream.
void take_transforms(std::string_view topic, std::string_view type, std::span<const std::uint8_t> bytes,
                     MessageLayout layout, FrameTree& frames);

// What takes points of one stream of a RealSense recording into another's, by their image topics (".../image/data").
[[nodiscard]] std::optional<RigidTransform> between_streams(const FrameTree& frames, std::string_view from,
                                                            std::string_view to);

}  // namespace stillmesh
