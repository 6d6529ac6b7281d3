#include "engine/tracking/empty_places.hpp"

#include <algorithm>
#include <cmath>

#include "engine/base/numbers.hpp"

namespace stillmesh {

EmptyPlaces::Seen EmptyPlaces::examine(const MapPoint& point, const MeasuredFrame& measured,
                                       const SE3& camera_from_world, double noise_depth,
                                       Vector2& pixel) const noexcept {
    const EmptinessParameters& p = parameters_->emptiness;
    const DepthParameters& depth = parameters_->depth;
    const Frame& frame = measured.frame();
    const CameraModel& camera = measured.camera();
    const Vector3 q = camera_from_world * vector_of(point.world);
    if (q.z() > depth.z_max_m || !project(camera, q, depth.z_min_m, pixel)) return Seen::kNothing;
    const auto reach_px = static_cast<std::int32_t>(p.reach_px);
    const auto width = static_cast<std::int32_t>(camera.width);
    const auto height = static_cast<std::int32_t>(camera.height);
    const std::int32_t x = round_clamped(pixel.x(), -100, width + 100);
    const std::int32_t y = round_clamped(pixel.y(), -100, height + 100);
    if (x < reach_px || y < reach_px || x >= width - reach_px || y >= height - reach_px) return Seen::kNothing;
    const double sigma = depth.sigma_z_per_m2 * q.z() * q.z();
    const double beyond = q.z() + p.margin_m + p.sigmas * std::sqrt((sigma * sigma + point.var_z) * noise_depth);
    const double metres_per_unit = 1.0 / frame.depth_units_per_m;
    bool is_empty = true;
    bool is_there = false;
    for (std::int32_t dy = -reach_px; dy <= reach_px; dy += reach_px) {
        for (std::int32_t dx = -reach_px; dx <= reach_px; dx += reach_px) {
            const std::uint16_t raw =
                frame.depth.row(static_cast<std::uint32_t>(y + dy))[static_cast<std::uint32_t>(x + dx)];
            const double z = raw * metres_per_unit;
            if (raw == 0 || z <= beyond) is_empty = false;
            if (raw != 0 && z <= beyond && z >= q.z() - (beyond - q.z())) is_there = true;
        }
    }
    return is_empty ? Seen::kEmpty : is_there ? Seen::kThere : Seen::kNothing;
}

void EmptyPlaces::note_empty(const MeasuredFrame& measured, const SE3& world_from_camera, double noise_depth,
                             World& world) noexcept {
    Map& map = world.map;
    const EmptinessParameters& p = parameters_->emptiness;
    const std::span<const std::uint32_t> slots = world.local_map.points();
    if (slots.empty()) return;
    const SE3 camera_from_world = world_from_camera.inverse();
    const auto places = static_cast<std::uint32_t>(std::min<std::size_t>(p.places_per_frame, slots.size()));
    for (std::uint32_t i = 0; i < places; ++i) {
        cursor_ = cursor_ + 1 < slots.size() ? cursor_ + 1 : 0;
        const std::uint32_t slot = slots[cursor_];
        if (!map.points().is_taken(slot)) continue;
        MapPoint& point = map.points().at(slot);
        if (point.last_seen_frame == world.clock.frame) {
            if (!point.is_suspect) point.empty_views = 0;
            continue;
        }
        Vector2 pixel;
        const Seen seen = examine(point, measured, camera_from_world, noise_depth, pixel);
        if (seen == Seen::kEmpty) {
            if (++point.empty_views < p.views) continue;
            map.release_point(map.points().handle_of(slot));
            ++map.statistics().points_emptied;
        } else if (seen == Seen::kThere && point.empty_views > 0) {
            --point.empty_views;
        }
    }
}

EmptyPlaces::Agreement EmptyPlaces::agreement(const MeasuredFrame& measured, const SE3& world_from_camera,
                                              double noise_depth, const World& world) const noexcept {
    Agreement out;
    std::int16_t more_there[kAgreementRows * kAgreementColumns] = {};  // points that are there less those that are not
    const Map& map = world.map;
    const CameraModel& camera = measured.camera();
    const std::span<const std::uint32_t> slots = world.local_map.points();
    const SE3 camera_from_world = world_from_camera.inverse();
    const std::size_t step = std::max<std::size_t>(1, slots.size() / kAgreementPlaces);
    for (std::size_t i = 0; i < slots.size(); i += step) {
        if (!map.points().is_taken(slots[i])) continue;
        const MapPoint& point = map.points().at(slots[i]);
        if (point.is_suspect) continue;
        Vector2 pixel;
        const Seen seen = examine(point, measured, camera_from_world, noise_depth, pixel);
        if (seen == Seen::kNothing) continue;
        const auto column = static_cast<std::uint32_t>(pixel.x() * kAgreementColumns / camera.width);
        const auto row = static_cast<std::uint32_t>(pixel.y() * kAgreementRows / camera.height);
        std::int16_t& more = more_there[row * kAgreementColumns + column];
        more = static_cast<std::int16_t>(more + (seen == Seen::kThere ? 1 : -1));
        out.points_there += seen == Seen::kThere ? 1U : 0U;
    }
    for (const std::int16_t more : more_there) {
        out.there += more > 0 ? 1U : 0U;
        out.empty += more < 0 ? 1U : 0U;
    }
    return out;
}

}  // namespace stillmesh
