#include "engine/mapping/local_window.hpp"

#include <algorithm>
#include <cmath>

#include "engine/base/time.hpp"

namespace stillmesh {

void LocalWindow::create(Arena& arena, World& world) noexcept {
    world_ = &world;
    const Limits& limits = world.limits;
    const AdjustmentSizes size = sizes(limits);
    adjustment_.create(arena, size);
    keyframes_ = arena.array<WindowKeyframe>(size.free_keyframes_max + size.fixed_keyframes_max);
    points_ = arena.array<WindowPoint>(size.points_max);
    observations_ = arena.array<WindowObservation>(size.observations_max);
    index_ = arena.array<std::uint32_t>(limits.map_points_max);
    counts_ = arena.array<std::uint16_t>(limits.keyframes_max);
}

void LocalWindow::forget_points() noexcept {
    for (std::uint32_t i = 0; i < point_count_; ++i) index_[points_[i].handle.slot()] = 0;
    is_chosen_ = false;
}

void LocalWindow::cancel() noexcept {
    adjustment_.begin();
    forget_points();
}

const LocalWindow::WindowPoint* LocalWindow::find(Handle<MapPoint> point) const noexcept {
    if (index_[point.slot()] == 0) return nullptr;
    const WindowPoint& in = points_[index_[point.slot()] - 1];
    return in.handle == point ? &in : nullptr;
}

// --- choose ----------------------------------------------------------------------------------------------------------

std::uint32_t LocalWindow::take_in(Handle<Keyframe> handle, bool is_fixed) noexcept {
    Map& map = world_->map;
    const bool is_carried = map.carry_observations(handle, world_->camera.height);
    keyframes_[keyframe_count_++] = {handle, map.keyframes().find(handle)->world_from_camera, is_fixed};
    return is_carried ? static_cast<std::uint32_t>(map.observations(handle).size()) / 4 : 0U;
}

std::uint32_t LocalWindow::choose(Handle<Keyframe> keyframe, std::span<const Handle<Keyframe>> neighbours) noexcept {
    const MappingParameters& p = world_->parameters.mapping;
    const Pool<Keyframe>& keyframes = world_->map.keyframes();
    adjustment_.begin();
    keyframe_count_ = point_count_ = observation_count_ = 0;
    cursor_ = 0;
    std::uint32_t units = take_in(keyframe, false);
    const std::uint32_t free_max = std::min(sizes(world_->limits).free_keyframes_max, p.window_keyframes);
    const std::int64_t settled_ns =
        keyframes.find(keyframe)->time_ns - static_cast<std::int64_t>(p.settled_s * kSecond_ns);
    for (const Handle<Keyframe> handle : neighbours) {
        if (keyframe_count_ >= free_max) break;
        const Keyframe* const neighbour = keyframes.find(handle);
        // Those of an earlier visit hold still: adjusted to every later one the map would wander off with the years.
        if (neighbour == nullptr || neighbour->time_ns < settled_ns) continue;
        units += take_in(handle, false);
    }
    free_count_ = keyframe_count_;
    units += choose_points();
    units += choose_fixed();
    if (keyframe_count_ == free_count_) hold_the_oldest();
    // A few points far away fit a camera that stands aside and looks askance as well, and tracking follows the newest:
    // its own points have to be enough.
    is_chosen_ =
        p.is_adjusting && keyframe_count_ >= 2 && newest_point_count_ >= world_->parameters.pose.sure_inliers();
    if (!is_chosen_) {
        forget_points();
        return units + 1;
    }
    fill_adjustment();
    return units + point_count_ / 8 + keyframe_count_ + 1;
}

// Points of the free keyframes that two of all keyframes see, newest keyframe first; and how many of them each keyframe
// sees.
std::uint32_t LocalWindow::choose_points() noexcept {
    const Map& map = world_->map;
    std::uint32_t units = 0;
    std::fill(counts_.begin(), counts_.end(), std::uint16_t{0});
    for (std::uint32_t k = 0; k < free_count_; ++k) {
        const std::span<const Observation> seen = map.observations(keyframes_[k].handle);
        units += static_cast<std::uint32_t>(seen.size()) / 8;
        for (const Observation& o : seen) {
            if (point_count_ == points_.size()) break;
            const MapPoint* const point = map.points().find(o.point);
            if (point == nullptr || point->is_suspect || point->observers < 2) continue;
            if (index_[o.point.slot()] != 0) continue;
            WindowPoint& in = points_[point_count_++];
            in.handle = o.point;
            store(vector_of(point->world), in.world);
            index_[o.point.slot()] = point_count_;
            map.visit_observers(o.point.slot(), [&](std::uint32_t slot) { ++counts_[slot]; });
        }
        if (k == 0) newest_point_count_ = point_count_;
    }
    return units;
}

std::uint32_t LocalWindow::choose_fixed() noexcept {
    std::uint32_t units = 0;
    for (std::uint32_t k = 0; k < free_count_; ++k) counts_[keyframes_[k].handle.slot()] = 0;
    for (std::uint32_t k = 0; k < sizes(world_->limits).fixed_keyframes_max; ++k) {
        std::uint32_t best = 0;
        for (std::uint32_t slot = 1; slot < counts_.size(); ++slot) {
            if (counts_[slot] > counts_[best]) best = slot;
        }
        if (counts_[best] < world_->parameters.map.shared_min) break;
        counts_[best] = 0;
        units += take_in(world_->map.keyframes().handle_of(best), true);
    }
    return units;
}

// One has to say where the world is.
void LocalWindow::hold_the_oldest() noexcept {
    const auto frame_of = [&](std::uint32_t k) { return world_->map.keyframes().find(keyframes_[k].handle)->frame; };
    std::uint32_t oldest = 0;
    for (std::uint32_t k = 1; k < free_count_; ++k) {
        if (frame_of(k) < frame_of(oldest)) oldest = k;
    }
    keyframes_[oldest].is_fixed = true;
}

void LocalWindow::fill_adjustment() noexcept {
    for (std::uint32_t k = 0; k < keyframe_count_; ++k)
        STILLMESH_CHECK(adjustment_.add_keyframe(keyframes_[k].world_from_camera, keyframes_[k].is_fixed).is_ok());
    for (std::uint32_t i = 0; i < point_count_; ++i)
        STILLMESH_CHECK(adjustment_.add_point(vector_of(points_[i].world)).is_ok());
}

// --- collect ---------------------------------------------------------------------------------------------------------

std::uint32_t LocalWindow::collect() noexcept {
    const MappingParameters& p = world_->parameters.mapping;
    if (cursor_ == keyframe_count_) {
        AdjustmentOptions options;
        options.iterations_max[0] = p.first_iterations_max;
        options.iterations_max[1] = p.second_iterations_max;
        adjustment_.start(options);
        return 1;
    }
    // The map may have changed since the window was chosen: what is gone is left out.
    const std::uint32_t k = cursor_++;
    const Handle<Keyframe> handle = keyframes_[k].handle;
    const std::span<const Observation> seen = world_->map.observations(handle);
    // A camera that turns while it waits for its depth measures past the feature, as in tracking; the expected lag
    // stands for that of the frame.
    const Keyframe* const keyframe = world_->map.keyframes().find(handle);
    const double turn_rad_s = keyframe != nullptr ? std::sqrt(keyframe->speed.tail<3>().squaredNorm()) : 0.0;
    const double slip_per_m =
        turn_rad_s * world_->parameters.region.colour_depth_lag_s * world_->parameters.prediction.slip_share;
    for (std::uint32_t i = 0; i < seen.size(); ++i) {
        const Observation& o = seen[i];
        if (world_->map.points().find(o.point) == nullptr || find(o.point) == nullptr) continue;
        if (observation_count_ == observations_.size()) break;
        AdjustmentObservation in;
        in.keyframe = k;
        in.point = index_[o.point.slot()] - 1;
        in.x = static_cast<double>(o.normalised_x);
        in.y = static_cast<double>(o.normalised_y);
        in.var_pixel = world_->pixel_noise.var(o.level) * world_->noise.pixel / o.averaged;
        if (o.var_z >= 0) {
            in.z_m = static_cast<double>(o.z_m);
            const double slip = slip_per_m * in.z_m;
            in.var_z = static_cast<double>(o.var_z) * world_->noise.depth / o.averaged + slip * slip;
        }
        if (adjustment_.add_observation(in) != Status::kOk) continue;
        observations_[observation_count_++] = {static_cast<std::uint16_t>(k), static_cast<std::uint16_t>(i)};
    }
    return 1 + static_cast<std::uint32_t>(seen.size()) / 4;
}

// --- commit ----------------------------------------------------------------------------------------------------------

std::uint32_t LocalWindow::commit() noexcept {
    MappingStatistics& statistics = world_->statistics.mapping;
    const AdjustmentSummary& summary = adjustment_.summary();
    statistics.adjustment_iterations += summary.iterations;
    if (summary.outcome != AdjustmentOutcome::kUnchanged) {
        correct_map();
        statistics.observations_dropped += drop_outliers();
    }
    forget_points();
    return world_->limits.map_points_max / 16 + observation_count_ / 8;
}

void LocalWindow::correct_map() noexcept {
    Map& map = world_->map;
    MapCorrection& correction = world_->map_correction;
    correction.begin();
    std::uint64_t newest = 0;
    for (std::uint32_t k = 0; k < keyframe_count_; ++k) {
        const WindowKeyframe& in = keyframes_[k];
        const Keyframe* const keyframe = map.keyframes().find(in.handle);
        if (keyframe == nullptr) continue;
        newest = std::max(newest, keyframe->frame);
        if (!in.is_fixed) correction.correct(map, in.handle, in.world_from_camera, adjustment_.pose(k));
    }
    correction.follow(map, newest + 1);
    if (const SE3* const of_camera = correction.of_newest(map); of_camera != nullptr) world_->move_camera(*of_camera);
    correction.move_points(map, [this](std::uint32_t slot, const MapPoint& point, Vector3& world) {
        const WindowPoint* const in = find(world_->map.points().handle_of(slot));
        if (in == nullptr || point.is_suspect || !adjustment_.is_point_used(index_[slot] - 1)) return false;
        // What tracking has learnt meanwhile stays.
        world = adjustment_.point(index_[slot] - 1) + (vector_of(point.world) - vector_of(in->world));
        for (int i = 0; i < 3; ++i) world_->map.note_change(world(i));
        return true;
    });
}

// Observations that fit nowhere end; how many did.
std::uint32_t LocalWindow::drop_outliers() noexcept {
    Map& map = world_->map;
    std::uint32_t dropped = 0;
    for (std::uint32_t i = 0; i < observation_count_; ++i) {
        if (!adjustment_.is_outlier(i)) continue;
        const Handle<Keyframe> handle = keyframes_[observations_[i].keyframe].handle;
        if (map.keyframes().find(handle) == nullptr) continue;
        const Handle<MapPoint> seen = map.observations(handle)[observations_[i].feature].point;
        const MapPoint* const point = map.points().find(seen);
        if (point == nullptr || find(seen) == nullptr) continue;
        if (point->observers < 2) continue;  // what tracking still follows is not lost for one look
        map.unlink(handle, observations_[i].feature);
        ++dropped;
    }
    return dropped;
}

}  // namespace stillmesh
