#include "hal/bag/frame_tree.hpp"

#include <algorithm>
#include <array>
#include <cmath>
#include <vector>

namespace stillmesh {
namespace {

constexpr std::size_t kNameMax = 256;
constexpr std::size_t kDepthMax = 64;  // of a tree; a circle ends there

[[nodiscard]] std::string_view plain(std::string_view frame) noexcept {
    return frame.substr(frame.starts_with('/') ? 1 : 0, kNameMax);
}

// False: a rotation that is none.
[[nodiscard]] bool read_transform(MessageReader& reader, RigidTransform& out) noexcept {
    double norm = 0;
    for (double& value : out.translation_m) value = reader.f64();
    for (double& value : out.rotation_xyzw) {
        value = reader.f64();
        norm += value * value;
    }
    norm = std::sqrt(norm);
    bool is_finite = norm > 0.5 && norm < 2;
    for (double& value : out.rotation_xyzw) value /= norm;
    for (const double value : out.translation_m) is_finite = is_finite && std::fabs(value) < 1e6;
    return reader.is_ok() && is_finite;
}

constexpr std::string_view kStreamTransform = "/tf/";
constexpr std::string_view kImage = "/image/data";

}  // namespace

void FrameTree::add(std::string_view frame, std::string_view parent, const RigidTransform& parent_from_frame) {
    if (links_.size() >= kTransformsMax || links_.contains(frame)) return;
    links_.emplace(std::string(frame), Link{std::string(parent), parent_from_frame});
}

void FrameTree::take(std::string_view topic, std::string_view type, std::span<const std::uint8_t> bytes,
                     MessageLayout layout) {
    MessageReader reader(bytes, layout);
    RigidTransform transform;
    if (type == kTransformType) {
        // ".../Depth_0/tf/0": from the reference's frame into the stream's (librealsense, ros_writer).
        const std::size_t at = topic.rfind(kStreamTransform);
        if (at == std::string_view::npos || !read_transform(reader, transform)) return;
        const std::string_view reference = topic.substr(at);
        add(topic.substr(0, std::min(at, kNameMax)), plain(reference), inverse_of(transform));
    }
    if (type != kTransformsType && type != kOldTransformsType) return;
    for (std::uint32_t left = reader.u32(); left > 0 && reader.is_ok(); --left) {
        const std::string_view parent = plain(read_header(reader).frame_id);
        const std::string_view frame = plain(reader.text());
        const bool is_right = read_transform(reader, transform);
        if (is_right && frame != parent) add(frame, parent, transform);
    }
}

std::optional<RigidTransform> FrameTree::between(std::string_view from, std::string_view to) const {
    struct Step {
        std::string_view frame;
        RigidTransform frame_from_start;
    };
    const auto way_up = [this](std::string_view frame) {
        std::vector<Step> way = {{frame, {}}};
        for (auto at = links_.find(frame); at != links_.end() && way.size() < kDepthMax;
             at = links_.find(at->second.parent)) {
            way.push_back({at->second.parent, compose(at->second.parent_from_frame, way.back().frame_from_start)});
        }
        return way;
    };
    const std::vector<Step> up = way_up(plain(from)), down = way_up(plain(to));
    for (const Step& one : up) {
        for (const Step& other : down) {
            if (one.frame == other.frame) return compose(inverse_of(other.frame_from_start), one.frame_from_start);
        }
    }
    return std::nullopt;
}

std::optional<RigidTransform> FrameTree::between_streams(std::string_view from, std::string_view to) const {
    for (std::string_view* const topic : {&from, &to}) {
        if (!topic->ends_with(kImage)) return std::nullopt;
        topic->remove_suffix(kImage.size());
    }
    // Streams are frames whose names begin with a slash, and others' never do.
    const auto a = links_.find(from), b = links_.find(to);
    if (a == links_.end() || b == links_.end() || a->second.parent != b->second.parent) return std::nullopt;
    return compose(inverse_of(b->second.parent_from_frame), a->second.parent_from_frame);
}

}  // namespace stillmesh
