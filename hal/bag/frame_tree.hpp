// How the frames of a robot lie to each other, from the transforms in a bag (/tf_static, and /tf for what was sent
// there as well), and what RealSense's own recordings say beside each stream: enough to say where a depth camera stands
// beside a colour camera. The first transform of a frame counts: two cameras of one housing do not move. Limits:
// kTransformsMax frames. Cost: nothing that counts. Any bytes are safe.
#pragma once

#include <map>
#include <optional>
#include <span>
#include <string>
#include <string_view>

#include "engine/geometry/rigid_transform.hpp"
#include "hal/bag/ros_messages.hpp"

namespace stillmesh {

class FrameTree {
public:
    static constexpr std::size_t kTransformsMax = 4096;

    // A message of kTransformsType, kOldTransformsType or kTransformType; others are passed over. `topic` tells a
    // RealSense stream.
    void take(std::string_view topic, std::string_view type, std::span<const std::uint8_t> bytes, MessageLayout layout);

    // What takes points of frame `from` into `to`. Empty: nothing connects them.
    [[nodiscard]] std::optional<RigidTransform> between(std::string_view from, std::string_view to) const;
    // Of two streams of a RealSense recording, by their image topics (".../image/data").
    [[nodiscard]] std::optional<RigidTransform> between_streams(std::string_view from, std::string_view to) const;

private:
    struct Link {
        std::string parent;
        RigidTransform parent_from_frame;
    };
    void add(std::string_view frame, std::string_view parent, const RigidTransform& parent_from_frame);
    std::map<std::string, Link, std::less<>> links_;
};

}  // namespace stillmesh
