#include "engine/recognition/map_drift.hpp"

#include <algorithm>
#include <cmath>

namespace stillmesh {
namespace {

double gathered_between(const Keyframe& a, const Keyframe& b) noexcept {
    return std::abs(static_cast<double>(a.drift_m) - static_cast<double>(b.drift_m));
}

// Of a keyframe that has a parent.
double drift_from_parent(const Map& map, std::uint32_t slot, const LoopParameters& parameters) noexcept {
    const Keyframe& keyframe = map.keyframes().at(slot);
    const std::uint32_t above = keyframe.parent.slot();
    const Keyframe& parent = map.keyframes().at(above);
    const double gathered = gathered_between(keyframe, parent);
    const std::uint64_t gap =
        keyframe.frame > parent.frame ? keyframe.frame - parent.frame : parent.frame - keyframe.frame;
    if (gap < parameters.gap_frames || map.shared(slot, above) < map.parameters().shared_min) return gathered;
    const Vector3 way = keyframe.world_from_camera.translation - parent.world_from_camera.translation;
    return std::min(gathered, parameters.drift_share * std::sqrt(way.squaredNorm()));
}

std::uint32_t depth_of(const Map& map, std::uint32_t slot) noexcept {
    std::uint32_t depth = 0;
    for (; !map.keyframes().at(slot).parent.is_null(); ++depth) slot = map.keyframes().at(slot).parent.slot();
    return depth;
}

}  // namespace

double drift_between(const Map& map, std::uint32_t slot_a, std::uint32_t slot_b,
                     const LoopParameters& parameters) noexcept {
    double sum = 0;
    const auto climb = [&](std::uint32_t& slot) {
        sum += drift_from_parent(map, slot, parameters);
        slot = map.keyframes().at(slot).parent.slot();
    };
    std::uint32_t depth_a = depth_of(map, slot_a), depth_b = depth_of(map, slot_b);
    for (; depth_a > depth_b; --depth_a) climb(slot_a);
    for (; depth_b > depth_a; --depth_b) climb(slot_b);
    while (slot_a != slot_b) {  // the tree has one root
        climb(slot_a);
        climb(slot_b);
    }
    return sum;
}

}  // namespace stillmesh
