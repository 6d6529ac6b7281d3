#include "engine/map/depth_images.hpp"

#include <algorithm>

#include "engine/geometry/camera.hpp"

namespace stillmesh {

DepthLayout depth_layout(const CameraModel& camera) noexcept {
    const std::uint32_t cell_px = std::max((camera.width + kDepthColumnsMax - 1) / kDepthColumnsMax,
                                           (camera.height + kDepthRowsMax - 1) / kDepthRowsMax);
    if (cell_px == 0) return {};
    return {camera.width / cell_px, camera.height / cell_px, cell_px};
}

void DepthImages::create(Arena& arena, const Limits& limits, const CameraModel& camera) noexcept {
    if (limits.depth_images_max == 0) return;
    owners_ = arena.array<Owner>(limits.depth_images_max);
    depth_mm_ = arena.array<std::uint16_t>(std::size_t{limits.depth_images_max} * kDepthCellsMax);
    rays_ = arena.array<float>(std::size_t{2} * kDepthCellsMax);
    layout_ = depth_layout(camera);
    const auto [columns, rows, cell_px] = layout_;
    const double middle = 0.5 * (cell_px - 1);
    for (std::uint32_t row = 0; row < rows; ++row) {
        for (std::uint32_t column = 0; column < columns; ++column) {
            const Vector2 ray = undistort_to_normalised(camera, {column * cell_px + middle, row * cell_px + middle});
            const std::size_t cell = std::size_t{row} * columns + column;
            rays_[2 * cell] = static_cast<float>(ray.x());
            rays_[2 * cell + 1] = static_cast<float>(ray.y());
        }
    }
}

void DepthImages::reset() noexcept {
    std::fill(owners_.begin(), owners_.end(), Owner{});
}

std::size_t DepthImages::place_for(const Owner& owner, const Pool<Keyframe>& keyframes) const noexcept {
    // 0: any, the last resort; above, those that may go rather.
    const auto worth = [&owner](const Owner& other) {
        return owner.is_later ? (other.keyframe == owner.keyframe ? 1 : 0) : (other.is_later ? 1 : 0);
    };
    std::size_t chosen = 0;
    for (std::size_t i = 0; i < owners_.size(); ++i) {
        if (keyframes.find(owners_[i].keyframe) == nullptr) return i;
        const int more = worth(owners_[i]) - worth(owners_[chosen]);
        if (more > 0 || (more == 0 && owners_[i].frame < owners_[chosen].frame)) chosen = i;
    }
    return chosen;
}

std::span<std::uint16_t> DepthImages::add(const Owner& owner, const Pool<Keyframe>& keyframes) noexcept {
    STILLMESH_CHECK(is_on());
    const std::size_t place = place_for(owner, keyframes);
    // What takes the place of a keyframe's own image is its own from then on.
    const bool is_free = keyframes.find(owners_[place].keyframe) == nullptr;
    const bool is_later = owner.is_later && (is_free || owners_[place].is_later);
    Owner kept = owner;
    kept.is_later = is_later;
    return put(static_cast<std::uint32_t>(place), kept);
}

std::span<std::uint16_t> DepthImages::put(std::uint32_t index, const Owner& owner) noexcept {
    owners_[index] = owner;
    return depth_mm_.subspan(std::size_t{index} * kDepthCellsMax, cells());
}

DepthImage DepthImages::at(std::uint32_t index, const Pool<Keyframe>& keyframes) const noexcept {
    if (index >= owners_.size()) return {};
    const Owner& owner = owners_[index];
    const Keyframe* const keyframe = keyframes.find(owner.keyframe);
    if (keyframe == nullptr) return {};
    return {columns(), rows(),      depth_mm(index),
            rays(),    owner.frame, transform_of(keyframe->world_from_camera * owner.keyframe_from_camera)};
}

}  // namespace stillmesh
