#include "engine/map/map.hpp"

#include <algorithm>

#include "engine/base/sort.hpp"

namespace stillmesh {

void Map::create(Arena& arena, const Limits& limits) noexcept {
    points_.create(arena, limits.map_points_max);
    keyframes_.create(arena, limits.keyframes_max);
    observations_ = arena.array<Observation>(static_cast<std::size_t>(limits.keyframes_max) * limits.features_max);
    by_age_ = arena.array<std::uint64_t>(limits.map_points_max);
    features_max_ = limits.features_max;
}

void Map::reset() noexcept {
    points_.reset();
    keyframes_.reset();
    keyframes_forgotten_ = 0;
    points_forgotten_ = 0;
}

void Map::make_room_for_points(std::uint32_t count, std::uint64_t frame) noexcept {
    // 40 bits of frame (a thousand years at 30 Hz) and 24 bits of slot order like the pair does.
    STILLMESH_CHECK(points_.slots_count() < (1U << 24U));
    std::size_t candidates = 0;
    for (std::uint32_t slot = 0; slot < points_.slots_count(); ++slot) {
        if (!points_.is_taken(slot) || points_.at(slot).last_seen_frame >= frame) continue;
        by_age_[candidates++] = points_.at(slot).last_seen_frame << 24U | slot;
    }
    const std::size_t going = std::min<std::size_t>(count, candidates);
    const auto begin = by_age_.begin();
    std::nth_element(begin, begin + static_cast<std::ptrdiff_t>(going),
                     begin + static_cast<std::ptrdiff_t>(candidates));
    // Release in slot order, so that the free list does not depend on how the library partitions.
    sort(by_age_.first(going));
    for (std::size_t i = 0; i < going; ++i) {
        points_.release(points_.handle_of(static_cast<std::uint32_t>(by_age_[i] & 0xffffffU)));
    }
    points_forgotten_ += going;
}

void Map::cull_points(std::uint64_t frame) noexcept {
    for (std::uint32_t slot = 0; slot < points_.slots_count(); ++slot) {
        if (!points_.is_taken(slot)) continue;
        const MapPoint& point = points_.at(slot);
        if (point.last_seen_frame + kCullAfter_frames >= frame) continue;
        if (!point.is_suspect && point.seen >= kSeenMin) continue;
        points_.release(points_.handle_of(slot));
        ++points_forgotten_;
    }
}

Handle<Keyframe> Map::add_keyframe() noexcept {
    if (keyframes_.is_full()) {
        keyframes_.release(recent_keyframe(static_cast<std::uint32_t>(keyframes_.size()) - 1));
        ++keyframes_forgotten_;
    }
    const Result<Handle<Keyframe>> taken = keyframes_.take();
    return taken.value();
}

void Map::add_observation(Handle<Keyframe> keyframe, const Observation& observation) noexcept {
    Keyframe* const found = keyframes_.find(keyframe);
    STILLMESH_CHECK(found != nullptr && found->observations < features_max_);
    observations_[static_cast<std::size_t>(keyframe.slot()) * features_max_ + found->observations++] = observation;
}

std::span<const Observation> Map::observations(Handle<Keyframe> keyframe) const noexcept {
    const Keyframe* const found = keyframes_.find(keyframe);
    if (found == nullptr) return {};
    return observations_.subspan(static_cast<std::size_t>(keyframe.slot()) * features_max_, found->observations);
}

Handle<Keyframe> Map::recent_keyframe(std::uint32_t i) const noexcept {
    if (i >= keyframes_.size()) return {};
    // Slots are handed out and released in turn (first in, first out), so age follows the slots round the ring.
    std::uint32_t newest = 0;
    bool is_found = false;
    for (std::uint32_t slot = 0; slot < keyframes_.slots_count(); ++slot) {
        if (!keyframes_.is_taken(slot)) continue;
        if (!is_found || keyframes_.at(slot).frame > keyframes_.at(newest).frame) newest = slot;
        is_found = true;
    }
    const std::uint32_t slot = (newest + keyframes_.slots_count() - i) % keyframes_.slots_count();
    return keyframes_.handle_of(slot);
}

}  // namespace stillmesh
