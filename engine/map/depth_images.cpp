#include "engine/map/depth_images.hpp"

#include <algorithm>
#include <limits>

#include "engine/geometry/camera.hpp"
#include "engine/geometry/view_distance.hpp"

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

// Of the two views nearest to each other the one that has a third nearest to it: were it always the older, the way of
// the first map would be eaten up from its begin.
std::size_t DepthImages::least_needed(const Owner* newcomer, const Pool<Keyframe>& keyframes) const noexcept {
    const std::size_t end = owners_.size() + (newcomer == nullptr ? 0 : 1);
    const auto owner_at = [&](std::size_t i) -> const Owner& { return i < owners_.size() ? owners_[i] : *newcomer; };
    // Calls visitor(i, m^2) for those before `until` and how far they are from one of them.
    const auto visit_others = [&](std::size_t from, std::size_t until, auto&& visitor) {
        const Keyframe* const keyframe = keyframes.find(owner_at(from).keyframe);
        if (keyframe == nullptr) return;
        const SE3 view = keyframe->world_from_camera * owner_at(from).keyframe_from_camera;
        for (std::size_t i = 0; i < until; ++i) {
            const Keyframe* const there = i != from ? keyframes.find(owner_at(i).keyframe) : nullptr;
            if (there == nullptr) continue;
            visitor(i, view_distance_m2(view, there->world_from_camera * owner_at(i).keyframe_from_camera));
        }
    };
    constexpr double kFar_m2 = std::numeric_limits<double>::max();
    std::size_t one = end, other = end;
    double least_m2 = kFar_m2;
    for (std::size_t i = 0; i < end; ++i) {
        if (one == end && keyframes.find(owner_at(i).keyframe) != nullptr) one = other = i;  // it may be the only one
        visit_others(i, i, [&](std::size_t k, double m2) {
            if (m2 >= least_m2) return;
            least_m2 = m2;
            one = owner_at(i).frame < owner_at(k).frame ? i : k;
            other = one == i ? k : i;
        });
    }
    double third_of_one_m2 = kFar_m2, third_of_other_m2 = kFar_m2;
    visit_others(one, end, [&](std::size_t i, double m2) {
        if (i != other) third_of_one_m2 = std::min(third_of_one_m2, m2);
    });
    visit_others(other, end, [&](std::size_t i, double m2) {
        if (i != one) third_of_other_m2 = std::min(third_of_other_m2, m2);
    });
    return third_of_one_m2 <= third_of_other_m2 ? one : other;  // if equal the older
}

std::span<std::uint16_t> DepthImages::join(const Owner& owner, const Pool<Keyframe>& keyframes) noexcept {
    STILLMESH_CHECK(is_on());
    const auto is_free = [&](const Owner& other) { return keyframes.find(other.keyframe) == nullptr; };
    auto place = static_cast<std::size_t>(std::find_if(owners_.begin(), owners_.end(), is_free) - owners_.begin());
    if (place == owners_.size()) place = least_needed(&owner, keyframes);
    if (place == owners_.size()) return {};
    return put(static_cast<std::uint32_t>(place), owner);
}

void DepthImages::thin(std::size_t most, const Pool<Keyframe>& keyframes) noexcept {
    std::size_t count = 0;
    for (const Owner& owner : owners_) count += keyframes.find(owner.keyframe) != nullptr ? 1U : 0U;
    for (; count > most; --count) owners_[least_needed(nullptr, keyframes)] = {};
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
