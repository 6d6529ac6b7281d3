// How the frames of a robot lie to each other, from the transforms that it tells (ROS's /tf_static): enough to say
// where a depth camera stands beside a colour camera. The first transform of a frame counts: two cameras of one housing
// do not move. Limits: kTransformsMax frames, names of 256 letters. Cost: nothing that counts. Any names and numbers
// are safe.
#pragma once

#include <map>
#include <optional>
#include <span>
#include <string>
#include <string_view>

#include "engine/geometry/rigid_transform.hpp"

namespace stillmesh {

class FrameTree {
public:
    static constexpr std::size_t kTransformsMax = 4096;

    // A frame's name as others write it: one of tf had a slash before it.
    [[nodiscard]] static std::string_view plain(std::string_view frame) noexcept;

    // Translation x y z (m) and rotation x y z w take points of `frame` into `parent`. What is no rotation, or no
    // number, is passed over, as is the second transform of a frame.
    void add(std::string_view frame, std::string_view parent, std::span<const double, 3> translation_m,
             std::span<const double, 4> rotation_xyzw);
    void add(std::string_view frame, std::string_view parent, const RigidTransform& parent_from_frame);

    // What takes points of frame `from` into `to`. Empty: nothing connects them.
    [[nodiscard]] std::optional<RigidTransform> between(std::string_view from, std::string_view to) const;
    // The same, of two frames with one parent.
    [[nodiscard]] std::optional<RigidTransform> between_siblings(std::string_view from, std::string_view to) const;

private:
    struct Link {
        std::string parent;
        RigidTransform parent_from_frame;
    };
    std::map<std::string, Link, std::less<>> links_;
};

// Of three and four numbers as they are sent. Empty: a rotation that is none, a place that is none.
[[nodiscard]] std::optional<RigidTransform> rigid_transform_of(std::span<const double, 3> translation_m,
                                                               std::span<const double, 4> rotation_xyzw) noexcept;

}  // namespace stillmesh
