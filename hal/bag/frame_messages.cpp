#include "hal/bag/frame_messages.hpp"

#include <algorithm>

namespace stillmesh {
namespace {

constexpr std::size_t kNameMax = 256;
constexpr std::string_view kStreamTransform = "/tf/";
constexpr std::string_view kImage = "/image/data";

struct Numbers {
    double translation_m[3] = {}, rotation_xyzw[4] = {};
};

// False: the bytes end before it does.
[[nodiscard]] bool read_numbers(MessageReader& reader, Numbers& out) noexcept {
    for (double& value : out.translation_m) value = reader.f64();
    for (double& value : out.rotation_xyzw) value = reader.f64();
    return reader.is_ok();
}

}  // namespace

void take_transforms(std::string_view topic, std::string_view type, std::span<const std::uint8_t> bytes,
                     MessageLayout layout, FrameTree& frames) {
    MessageReader reader(bytes, layout);
    Numbers numbers;
    if (type == kTransformType) {
        // ".../Depth_0/tf/0": from the reference's frame into the stream's (librealsense, ros_writer). Streams are
        // frames whose names begin with a slash, and others' never do.
        const std::size_t at = topic.rfind(kStreamTransform);
        if (at == std::string_view::npos || !read_numbers(reader, numbers)) return;
        const auto transform = rigid_transform_of(numbers.translation_m, numbers.rotation_xyzw);
        if (!transform) return;
        frames.add(topic.substr(0, std::min(at, kNameMax)), FrameTree::plain(topic.substr(at)), inverse_of(*transform));
    }
    if (type != kTransformsType && type != kOldTransformsType) return;
    for (std::uint32_t left = reader.u32(); left > 0 && reader.is_ok(); --left) {
        const std::string_view parent = read_header(reader).frame_id;
        const std::string_view frame = reader.text();
        if (read_numbers(reader, numbers)) frames.add(frame, parent, numbers.translation_m, numbers.rotation_xyzw);
    }
}

std::optional<RigidTransform> between_streams(const FrameTree& frames, std::string_view from, std::string_view to) {
    for (std::string_view* const topic : {&from, &to}) {
        if (!topic->ends_with(kImage)) return std::nullopt;
        topic->remove_suffix(kImage.size());
    }
    return frames.between_siblings(from, to);
}

}  // namespace stillmesh
