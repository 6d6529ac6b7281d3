#include "hal/calibration/frame_tree.hpp"

#include <algorithm>
#include <cmath>
#include <vector>

namespace stillmesh {
namespace {

constexpr std::size_t kNameMax = 256;
constexpr std::size_t kLinksMax = 64;  // of a tree; a circle ends there

}  // namespace

std::string_view FrameTree::plain(std::string_view frame) noexcept {
    return frame.substr(frame.starts_with('/') ? 1 : 0, kNameMax);
}

std::optional<RigidTransform> rigid_transform_of(std::span<const double, 3> translation_m,
                                                 std::span<const double, 4> rotation_xyzw) noexcept {
    RigidTransform out;
    double norm = 0;
    for (const double value : rotation_xyzw) norm += value * value;
    norm = std::sqrt(norm);
    bool is_good = norm > 0.5 && norm < 2;
    for (std::size_t i = 0; i < 4; ++i) out.rotation_xyzw[i] = rotation_xyzw[i] / norm;
    for (std::size_t i = 0; i < 3; ++i) {
        out.translation_m[i] = translation_m[i];
        is_good = is_good && std::fabs(translation_m[i]) < 1e6;
    }
    return is_good ? std::optional(out) : std::nullopt;
}

void FrameTree::add(std::string_view frame, std::string_view parent, const RigidTransform& parent_from_frame) {
    if (links_.size() >= kTransformsMax || links_.contains(frame)) return;
    links_.emplace(std::string(frame), Link{std::string(parent), parent_from_frame});
}

void FrameTree::add(std::string_view frame, std::string_view parent, std::span<const double, 3> translation_m,
                    std::span<const double, 4> rotation_xyzw) {
    const std::optional<RigidTransform> transform = rigid_transform_of(translation_m, rotation_xyzw);
    if (transform && plain(frame) != plain(parent)) add(plain(frame), plain(parent), *transform);
}

std::optional<RigidTransform> FrameTree::between(std::string_view from, std::string_view to) const {
    struct Step {
        std::string_view frame;
        RigidTransform frame_from_start;
    };
    const auto way_up = [this](std::string_view frame) {
        std::vector<Step> way = {{frame, {}}};
        for (auto at = links_.find(frame); at != links_.end() && way.size() < kLinksMax;
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

std::optional<RigidTransform> FrameTree::between_siblings(std::string_view from, std::string_view to) const {
    const auto a = links_.find(from), b = links_.find(to);
    if (a == links_.end() || b == links_.end() || a->second.parent != b->second.parent) return std::nullopt;
    return compose(inverse_of(b->second.parent_from_frame), a->second.parent_from_frame);
}

}  // namespace stillmesh
