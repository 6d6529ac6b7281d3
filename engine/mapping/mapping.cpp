#include "engine/mapping/mapping.hpp"

#include <algorithm>
#include <cmath>

#include "engine/base/time.hpp"
#include "engine/map/eviction.hpp"
#include "engine/mapping/triangulation.hpp"

namespace stillmesh {
namespace {

constexpr std::uint32_t kCullChunk = 1024;  // slots in a piece
constexpr std::uint32_t kFuseChunk = 32;    // points in a piece

}  // namespace

void Mapping::create(Arena& arena, World& world) noexcept {
    world_ = &world;
    const Limits& limits = world.limits;
    adjustment_.create(arena, sizes(limits));
    fusion_.create(arena, world);
    problem_keyframes_ =
        arena.array<ProblemKeyframe>(sizes(limits).free_keyframes_max + sizes(limits).fixed_keyframes_max);
    problem_points_ = arena.array<ProblemPoint>(2 * limits.features_max);
    problem_observations_ = arena.array<ProblemObservation>(8 * limits.features_max);
    problem_index_ = arena.array<std::uint32_t>(limits.map_points_max);
    counts_ = arena.array<std::uint16_t>(limits.keyframes_max);
    // The longest pieces: the commit, which looks at every point; a feature against all of another keyframe; a chunk of
    // points of which each is fused.
    const std::uint32_t commit = limits.map_points_max / 16 + limits.features_max + 4 * limits.keyframes_max;
    const std::uint32_t fusing = kFuseChunk * PointFusion::units_max(limits);
    piece_units_max_ = std::max({commit, fusing, 2 * limits.features_max, LocalAdjustment::kPieceUnitsMax});
    reset();
}

void Mapping::reset() noexcept {
    adjustment_.begin();
    fusion_.reset();
    keyframe_ = {};
    stage_ = Stage::kIdle;
    cursor_ = other_ = 0;
    corrections_seen_ = 0;
    neighbour_count_ = 0;
    problem_keyframe_count_ = problem_point_count_ = problem_observation_count_ = 0;
    std::fill(problem_index_.begin(), problem_index_.end(), 0U);
    statistics_ = MappingStatistics{};
}

void Mapping::enter(Stage stage) noexcept {
    stage_ = stage;
    cursor_ = 0;
    other_ = 0;
    fusion_.forget_target();
}

bool Mapping::take() noexcept {
    Ring<Handle<Keyframe>>& queue = world_->keyframe_queue;
    while (!queue.is_empty()) {
        keyframe_ = queue[0];
        queue.pop();
        if (world_->map.keyframes().find(keyframe_) == nullptr) continue;  // evicted while it waited
        ++statistics_.keyframes_inserted;
        enter(Stage::kCull);
        return true;
    }
    return false;
}

Progress Mapping::step(WorkBudget& budget) noexcept {
    heed_correction();
    if (stage_ == Stage::kIdle && !take()) return Progress::kIdle;
    while (!budget.is_spent()) {
        // Only tracking evicts besides the last stages, and never the newest; but the queue may have been long.
        if (world_->map.keyframes().find(keyframe_) == nullptr && stage_ < Stage::kRedundant) {
            drop_adjustment();
            enter(Stage::kEvict);
        }
        switch (stage_) {
            case Stage::kIdle: return Progress::kDone;
            case Stage::kCull: budget.spend(cull()); break;
            case Stage::kTriangulate: budget.spend(triangulate()); break;
            case Stage::kFuse: budget.spend(fuse()); break;
            case Stage::kChoose: budget.spend(choose_window()); break;
            case Stage::kCollect: budget.spend(collect()); break;
            case Stage::kAdjust:
                ++statistics_.adjustment_slices;
                if (adjustment_.step(budget) != Progress::kWorking) enter(Stage::kCommit);
                break;
            case Stage::kCommit: budget.spend(commit()); break;
            case Stage::kRedundant: budget.spend(drop_redundant()); break;
            case Stage::kEvict: budget.spend(evict()); break;
        }
    }
    return stage_ == Stage::kIdle ? Progress::kDone : Progress::kWorking;
}

void Mapping::drop_adjustment() noexcept {
    adjustment_.cancel();
    for (std::uint32_t i = 0; i < problem_point_count_; ++i) problem_index_[problem_points_[i].handle.slot()] = 0;
    problem_point_count_ = 0;
    ++statistics_.adjustments_dropped;
}

// The whole map moved since the window was chosen: what is known of it is out of date.
void Mapping::heed_correction() noexcept {
    if (corrections_seen_ == world_->corrections) return;
    corrections_seen_ = world_->corrections;
    if (stage_ != Stage::kCollect && stage_ != Stage::kAdjust && stage_ != Stage::kCommit) return;
    drop_adjustment();
    enter(Stage::kRedundant);
}

// --- points ----------------------------------------------------------------------------------------------------------

std::uint32_t Mapping::cull() noexcept {
    cursor_ = cull_points(world_->map, world_->clock.frame, cursor_, kCullChunk);
    if (cursor_ == 0) {
        find_neighbours();
        enter(Stage::kTriangulate);
    }
    return kCullChunk / 16;
}

void Mapping::find_neighbours() noexcept {
    std::uint32_t best[kNeighboursMax] = {};
    neighbour_count_ = world_->map.best_covisible(keyframe_.slot(), best, world_->configuration.mapping.shared_min);
    for (std::uint32_t i = 0; i < neighbour_count_; ++i) neighbours_[i] = world_->map.keyframes().handle_of(best[i]);
}

std::uint32_t Mapping::triangulate() noexcept {
    // One feature with one neighbour a piece; those that need nothing are passed over.
    const std::span<const Observation> here = world_->map.observations(keyframe_);
    std::uint32_t passed = 0;
    const std::uint32_t with =
        world_->configuration.mapping.is_triangulating ? world_->configuration.mapping.triangulation_keyframes : 0U;
    while (other_ < std::min(neighbour_count_, with)) {
        const Handle<Keyframe> other = neighbours_[other_];
        if (world_->map.keyframes().find(other) != nullptr) {
            while (cursor_ < here.size()) {
                const std::uint32_t feature = cursor_++;
                ++passed;
                if (here[feature].var_z >= 0 || world_->map.points().find(here[feature].point) != nullptr) continue;
                const Triangulation made = stillmesh::triangulate(world_->map, keyframe_, feature, other,
                                                                  world_->configuration, world_->pixel_noise);
                if (!made.point.is_null()) {
                    world_->local_map.add(made.point.slot());
                    ++statistics_.points_triangulated;
                }
                return 1 + passed / 16 + made.units;
            }
        }
        cursor_ = 0;
        ++other_;
    }
    enter(Stage::kFuse);
    return 1 + passed / 16;
}

std::uint32_t Mapping::fuse() noexcept {
    // Pairs: the neighbours' points into the new keyframe, then its points into theirs.
    const std::uint32_t with = world_->configuration.mapping.is_fusing
                                   ? std::min(neighbour_count_, world_->configuration.mapping.fusion_keyframes)
                                   : 0U;
    while (other_ < 2 * with) {
        const Handle<Keyframe> neighbour = neighbours_[other_ % with];
        const Handle<Keyframe> source = other_ < with ? neighbour : keyframe_;
        const Handle<Keyframe> target = other_ < with ? keyframe_ : neighbour;
        if (world_->map.keyframes().find(neighbour) == nullptr || cursor_ >= world_->map.observations(source).size()) {
            cursor_ = 0;
            ++other_;
            continue;
        }
        if (!fusion_.has_target(target)) return 1 + fusion_.set_target(target);
        const std::span<const Observation> seen = world_->map.observations(source);
        std::uint32_t units = 1;
        for (std::uint32_t i = 0; i < kFuseChunk && cursor_ < seen.size(); ++i) {
            units += fusion_.fuse(seen[cursor_++].point, world_->noise.depth);
        }
        return units;
    }
    enter(Stage::kChoose);
    return 1;
}

// --- adjustment ------------------------------------------------------------------------------------------------------

std::uint32_t Mapping::choose_window() noexcept {
    find_neighbours();
    adjustment_.begin();
    problem_keyframe_count_ = problem_point_count_ = problem_observation_count_ = 0;
    const AdjustmentSizes limits = sizes(world_->limits);
    const std::uint32_t free_max = std::min(limits.free_keyframes_max, world_->configuration.mapping.window_keyframes);
    std::uint32_t units = 0;
    readout_s_ = world_->map.readout_s();
    const auto take_in = [&](Handle<Keyframe> handle, bool is_fixed) {
        if (world_->map.carry_observations(handle, world_->camera.height)) {
            units += static_cast<std::uint32_t>(world_->map.observations(handle).size()) / 4;
        }
        ProblemKeyframe& in = problem_keyframes_[problem_keyframe_count_];
        in.handle = handle;
        in.world_from_camera = world_->map.keyframes().find(handle)->world_from_camera;
        in.is_fixed = is_fixed;
        ++problem_keyframe_count_;
    };
    take_in(keyframe_, false);
    const std::int64_t settled_ns = world_->map.keyframes().find(keyframe_)->time_ns -
                                    static_cast<std::int64_t>(world_->configuration.mapping.settled_s * kSecond_ns);
    for (std::uint32_t i = 0; i < neighbour_count_ && problem_keyframe_count_ < free_max; ++i) {
        const Keyframe* const neighbour = world_->map.keyframes().find(neighbours_[i]);
        // Those of an earlier visit hold still: adjusted to every later one the map would wander off with the years.
        if (neighbour == nullptr || neighbour->time_ns < settled_ns) continue;
        take_in(neighbours_[i], false);
    }
    free_count_ = problem_keyframe_count_;
    // Points of the free keyframes that two of all keyframes see, newest keyframe first; who else sees them.
    std::fill(counts_.begin(), counts_.end(), std::uint16_t{0});
    std::uint32_t newest_point_count = 0;
    for (std::uint32_t k = 0; k < free_count_; ++k) {
        const std::span<const Observation> seen = world_->map.observations(problem_keyframes_[k].handle);
        units += static_cast<std::uint32_t>(seen.size()) / 8;
        for (const Observation& o : seen) {
            if (problem_point_count_ == problem_points_.size()) break;
            const MapPoint* const point = world_->map.points().find(o.point);
            if (point == nullptr || point->is_suspect || point->observers < 2) continue;
            if (problem_index_[o.point.slot()] != 0) continue;
            ProblemPoint& in = problem_points_[problem_point_count_++];
            in.handle = o.point;
            store(vector_of(point->world), in.world);
            problem_index_[o.point.slot()] = problem_point_count_;
            world_->map.visit_observers(o.point.slot(), [&](std::uint32_t slot) { ++counts_[slot]; });
        }
        if (k == 0) newest_point_count = problem_point_count_;
    }
    for (std::uint32_t k = 0; k < free_count_; ++k) counts_[problem_keyframes_[k].handle.slot()] = 0;
    for (std::uint32_t k = 0; k < limits.fixed_keyframes_max; ++k) {
        std::uint32_t best = 0;
        for (std::uint32_t slot = 1; slot < counts_.size(); ++slot) {
            if (counts_[slot] > counts_[best]) best = slot;
        }
        if (counts_[best] < world_->configuration.mapping.fixed_shared_min) break;
        counts_[best] = 0;
        take_in(world_->map.keyframes().handle_of(best), true);
    }
    // Somebody must hold still: the oldest.
    if (problem_keyframe_count_ == free_count_) {
        std::uint32_t oldest = 0;
        const auto frame_of = [&](std::uint32_t k) {
            return world_->map.keyframes().find(problem_keyframes_[k].handle)->frame;
        };
        for (std::uint32_t k = 1; k < free_count_; ++k) {
            if (frame_of(k) < frame_of(oldest)) oldest = k;
        }
        problem_keyframes_[oldest].is_fixed = true;
    }
    // A few points far away fit a camera that stands aside and looks askance as well, and tracking follows the newest:
    // its own points have to be enough.
    const bool is_worth_it = world_->configuration.mapping.is_adjusting && problem_keyframe_count_ >= 2 &&
                             newest_point_count >= world_->configuration.mapping.adjusted_points_min;
    enter(is_worth_it ? Stage::kCollect : Stage::kRedundant);
    if (!is_worth_it) {
        for (std::uint32_t i = 0; i < problem_point_count_; ++i) {
            problem_index_[problem_points_[i].handle.slot()] = 0;
        }
        return units + 1;
    }
    for (std::uint32_t k = 0; k < problem_keyframe_count_; ++k) {
        const auto added =
            adjustment_.add_keyframe(problem_keyframes_[k].world_from_camera, problem_keyframes_[k].is_fixed);
        STILLMESH_CHECK(added.is_ok());
        problem_keyframes_[k].index = added.value();
    }
    for (std::uint32_t i = 0; i < problem_point_count_; ++i) {
        STILLMESH_CHECK(adjustment_.add_point(vector_of(problem_points_[i].world)).is_ok());
    }
    return units + problem_point_count_ / 8 + problem_keyframe_count_ + 1;
}

std::uint32_t Mapping::collect() noexcept {
    // One keyframe a piece. The map may have changed since the window was chosen: what is gone is left out.
    if (cursor_ < problem_keyframe_count_) {
        const std::uint32_t k = cursor_++;
        const Handle<Keyframe> handle = problem_keyframes_[k].handle;
        const std::span<const Observation> seen = world_->map.observations(handle);
        const double noise_pixel = world_->noise.pixel;
        const double noise_depth = world_->noise.depth;
        // A camera that turns while it waits for its depth measures past the feature, as in tracking; the expected lag
        // stands for that of the frame.
        const Keyframe* const keyframe = world_->map.keyframes().find(handle);
        const double turn_rad_s = keyframe != nullptr ? std::sqrt(keyframe->speed.tail<3>().squaredNorm()) : 0.0;
        const double slip_per_m =
            turn_rad_s * world_->configuration.region.colour_depth_lag_s * world_->configuration.prediction.slip_share;
        for (std::uint32_t i = 0; i < seen.size(); ++i) {
            const Observation& o = seen[i];
            const MapPoint* const point = world_->map.points().find(o.point);
            if (point == nullptr || problem_index_[o.point.slot()] == 0) continue;
            const std::uint32_t index = problem_index_[o.point.slot()] - 1;
            if (!(problem_points_[index].handle == o.point)) continue;
            if (problem_observation_count_ == problem_observations_.size()) break;
            AdjustmentObservation in;
            in.keyframe = problem_keyframes_[k].index;
            in.point = index;
            in.x = static_cast<double>(o.normalised_x);
            in.y = static_cast<double>(o.normalised_y);
            in.var_pixel = world_->pixel_noise.var(o.level) * noise_pixel / o.looks;
            if (o.var_z >= 0) {
                in.z_m = static_cast<double>(o.z_m);
                const double slip = slip_per_m * in.z_m;
                in.var_z = static_cast<double>(o.var_z) * noise_depth / o.looks + slip * slip;
            }
            if (adjustment_.add_observation(in) != Status::kOk) continue;
            problem_observations_[problem_observation_count_++] = {static_cast<std::uint16_t>(k),
                                                                   static_cast<std::uint16_t>(i)};
        }
        return 1 + static_cast<std::uint32_t>(seen.size()) / 4;
    }
    AdjustmentOptions options;
    options.chi2_max_pixel = world_->configuration.mapping.chi2_max_pixel;
    options.chi2_max_depth = world_->configuration.mapping.chi2_max_depth;
    options.iterations_max[0] = world_->configuration.mapping.first_iterations_max;
    options.iterations_max[1] = world_->configuration.mapping.second_iterations_max;
    adjustment_.start(options);
    ++statistics_.adjustments;
    enter(Stage::kAdjust);
    return 1;
}

std::uint32_t Mapping::commit() noexcept {
    const AdjustmentSummary& summary = adjustment_.summary();
    statistics_.adjustment_iterations += summary.iterations;
    if (summary.outcome != AdjustmentOutcome::kUnchanged) {
        correct_keyframes();
        correct_points();
        drop_outliers();
    }
    for (std::uint32_t i = 0; i < problem_point_count_; ++i) problem_index_[problem_points_[i].handle.slot()] = 0;
    enter(Stage::kRedundant);
    return world_->limits.map_points_max / 16 + problem_observation_count_ / 8;
}

void Mapping::correct_keyframes() noexcept {
    Map& map = world_->map;
    MapCorrection& correction = world_->map_correction;
    correction.begin();
    std::uint64_t newest = 0;
    for (std::uint32_t k = 0; k < problem_keyframe_count_; ++k) {
        const ProblemKeyframe& in = problem_keyframes_[k];
        const Keyframe* const keyframe = map.keyframes().find(in.handle);
        if (keyframe == nullptr) continue;
        newest = std::max(newest, keyframe->frame);
        if (in.is_fixed) continue;
        const SE3& pose = adjustment_.pose(in.index);
        // What was learnt of the readout meanwhile stays.
        const SE3 now = pose * se3_exp(keyframe->pose_by_readout * (map.readout_s() - readout_s_));
        correction.correct(map, in.handle, now, correction_between(pose, in.world_from_camera));
        for (int i = 0; i < 3; ++i) map.note_change(pose.translation(i));
    }
    correction.follow(map, newest + 1);
    if (const SE3* const of_camera = correction.of_newest(map); of_camera != nullptr) world_->move_camera(*of_camera);
}

void Mapping::correct_points() noexcept {
    Pool<MapPoint>& points = world_->map.points();
    for (std::uint32_t slot = 0; slot < points.slots_count(); ++slot) {
        if (!points.is_taken(slot)) continue;
        MapPoint& point = points.at(slot);
        const SE3* const correction =
            point.reference.is_null() ? nullptr : world_->map_correction.of(point.reference.slot());
        const std::uint32_t index = problem_index_[slot];
        const bool is_adjusted = index != 0 && problem_points_[index - 1].handle == points.handle_of(slot) &&
                                 !point.is_suspect && adjustment_.is_point_used(index - 1);
        if (is_adjusted) {
            // What tracking has learnt meanwhile stays.
            const Vector3 learnt = vector_of(point.world) - vector_of(problem_points_[index - 1].world);
            store(adjustment_.point(index - 1) + learnt, point.world);
            for (const double w : point.world) world_->map.note_change(w);
        } else if (correction != nullptr) {
            store(*correction * vector_of(point.world), point.world);
        }
        if (correction != nullptr) store(*correction * vector_of(point.anchor), point.anchor);
    }
}

void Mapping::drop_outliers() noexcept {
    for (std::uint32_t i = 0; i < problem_observation_count_; ++i) {
        if (!adjustment_.is_outlier(i)) continue;
        const ProblemObservation& in = problem_observations_[i];
        const Handle<Keyframe> handle = problem_keyframes_[in.keyframe].handle;
        if (world_->map.keyframes().find(handle) == nullptr) continue;
        const Handle<MapPoint> seen = world_->map.observations(handle)[in.feature].point;
        const MapPoint* const point = world_->map.points().find(seen);
        if (point == nullptr || problem_index_[seen.slot()] == 0) continue;
        if (!(problem_points_[problem_index_[seen.slot()] - 1].handle == seen)) continue;
        if (point->observers < 2) continue;  // what tracking still follows is not lost for one look
        world_->map.unlink(handle, in.feature);
        ++statistics_.observations_dropped;
    }
}

// --- room ------------------------------------------------------------------------------------------------------------

std::uint32_t Mapping::drop_redundant() noexcept {
    // One neighbour a piece; the newest keyframes have not had the time to prove themselves. While the pool is roomy
    // nobody goes: more looks at a place make it surer (measured, docs/mapping.md).
    const Pool<Keyframe>& pool = world_->map.keyframes();
    const bool is_roomy =
        pool.size() * 1000 <= pool.capacity() * std::size_t{world_->configuration.mapping.roomy_permille};
    if (cursor_ >= neighbour_count_ || is_roomy || !world_->configuration.mapping.is_culling) {
        enter(Stage::kEvict);
        return 1;
    }
    const Handle<Keyframe> handle = neighbours_[cursor_++];
    const Keyframe* const keyframe = world_->map.keyframes().find(handle);
    if (keyframe == nullptr || keyframe->parent.is_null()) return 1;
    if (handle == world_->map.recent_keyframe(0) || handle == world_->map.recent_keyframe(1)) return 1;
    if (is_redundant(world_->map, handle)) release_redundant(world_->map, handle);
    return 1 + world_->limits.features_max / 2;
}

std::uint32_t Mapping::evict() noexcept {
    const Pool<Keyframe>& keyframes = world_->map.keyframes();
    const Pool<MapPoint>& points = world_->map.points();
    const std::size_t keyframes_spare =
        std::max<std::size_t>(1, keyframes.capacity() * world_->configuration.mapping.spare_keyframes_permille / 1000);
    if (keyframes.capacity() - keyframes.size() < keyframes_spare && cursor_ < keyframes_spare) {
        ++cursor_;
        if (evict_keyframe(world_->map, world_->local_map.keyframes())) {
            const std::uint32_t compared = std::min(world_->limits.keyframes_max, kCrowdedCandidates);
            return 1 + world_->limits.features_max / 2 + 2 * world_->limits.keyframes_max + compared * compared / 4;
        }
    }
    const std::size_t points_spare = std::min<std::size_t>(
        world_->limits.features_max,
        static_cast<std::size_t>(std::uint64_t{world_->configuration.mapping.spare_points_permille} *
                                 points.capacity() / 1000));
    const std::size_t free = points.capacity() - points.size();
    stage_ = Stage::kIdle;
    if (free >= points_spare) return 1;
    static_cast<void>(make_room_for_points(world_->map, static_cast<std::uint32_t>(points_spare - free),
                                           world_->clock.frame, world_->local_map.spared()));
    return world_->limits.map_points_max / 16;
}

void Mapping::fill(EngineStatistics& statistics) const noexcept {
    statistics.mapping = statistics_;
    statistics.mapping.observations_found = fusion_.observations_found();
}

}  // namespace stillmesh
