#include "engine/tasks/mapping.hpp"

#include <algorithm>
#include <cmath>

#include "engine/base/numbers.hpp"
#include "engine/base/time.hpp"
#include "engine/features/hamming.hpp"

namespace stillmesh {
namespace {

constexpr std::uint32_t kCullChunk = 1024;       // slots in a piece
constexpr std::uint32_t kFuseChunk = 32;         // points in a piece
constexpr std::uint32_t kFuseObserversMax = 16;  // a point with more stays: its fusion would be a long piece
// Guards of the arithmetic: a baseline (squared) too short for an epipolar line, rays too parallel to meet, and where
// they meet too far for any depth camera; and, of what is projected, how far out (tangent, squared) a lens may see.
constexpr double kBaselineMin2 = 1e-12;
constexpr double kDeterminantMin = 1e-9;
constexpr double kFarthest_m = 100.0;
constexpr double kTangentMax2 = 4.0;
constexpr double kVarianceMin_m2 = 1e-6;

SE3 transform_between(const SE3& now, const SE3& before) noexcept {
    SE3 out = now * before.inverse();
    renormalise(out.rotation);
    return out;
}

}  // namespace

void Mapping::create(Arena& arena, const Limits& limits, const Configuration& configuration, const CameraModel& camera,
                     Tracking& tracking) noexcept {
    configuration_ = &tracking.configuration();
    camera_ = camera;
    limits_ = limits;
    tracking_ = &tracking;
    map_ = &tracking.map();
    adjustment_.create(arena, sizes(limits));
    grid_.create(arena, limits);
    keypoints_.create(arena, limits.features_max);
    problem_points_ = arena.array<ProblemPoint>(2 * limits.features_max);
    problem_observations_ = arena.array<ProblemObservation>(8 * limits.features_max);
    problem_index_ = arena.array<std::uint32_t>(limits.map_points_max);
    counts_ = arena.array<std::uint16_t>(limits.keyframes_max);
    corrections_ = arena.array<Correction>(limits.keyframes_max);
    pixel_noise_.create(configuration, camera);
    // The longest pieces: the commit, which looks at every point; a feature against all of another keyframe; a chunk of
    // points of which each is fused.
    const std::uint32_t commit = limits.map_points_max / 16 + limits.features_max + 4 * limits.keyframes_max;
    const std::uint32_t fusing = kFuseChunk * (kFuseObserversMax * limits.features_max / 64 + 8);
    piece_units_max_ = std::max({commit, fusing, 2 * limits.features_max, LocalAdjustment::kPieceUnitsMax});
    reset();
}

void Mapping::reset() noexcept {
    adjustment_.begin();
    grid_keyframe_ = {};
    keyframe_ = {};
    stage_ = Stage::kIdle;
    cursor_ = other_ = 0;
    neighbour_count_ = 0;
    problem_keyframe_count_ = problem_point_count_ = problem_observation_count_ = 0;
    std::fill(problem_index_.begin(), problem_index_.end(), 0U);
    statistics_ = MappingStatistics{};
}

void Mapping::enter(Stage stage) noexcept {
    stage_ = stage;
    cursor_ = 0;
    other_ = 0;
    grid_keyframe_ = {};
}

bool Mapping::take() noexcept {
    Ring<Handle<Keyframe>>& queue = tracking_->keyframe_queue();
    while (!queue.is_empty()) {
        keyframe_ = queue[0];
        queue.pop();
        if (map_->keyframes().find(keyframe_) == nullptr) continue;  // evicted while it waited
        ++statistics_.keyframes_inserted;
        enter(Stage::kCull);
        return true;
    }
    return false;
}

Progress Mapping::step(WorkBudget& budget) noexcept {
    if (stage_ == Stage::kIdle && !take()) return Progress::kIdle;
    while (!budget.is_spent()) {
        // Only tracking evicts besides the last stages, and never the newest; but the queue may have been long.
        if (map_->keyframes().find(keyframe_) == nullptr && stage_ < Stage::kRedundant) {
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

void Mapping::note_correction() noexcept {
    if (stage_ != Stage::kCollect && stage_ != Stage::kAdjust && stage_ != Stage::kCommit) return;
    drop_adjustment();
    enter(Stage::kRedundant);
}

std::uint32_t Mapping::fuse_into(Handle<MapPoint> point, Handle<Keyframe> target) noexcept {
    if (map_->keyframes().find(target) == nullptr) return 1;
    std::uint32_t units = 1;
    if (!(grid_keyframe_ == target)) {
        build_grid(target);
        units += static_cast<std::uint32_t>(keypoints_.size()) / 8;
    }
    return units + fuse_point(point, target);
}

// --- points ----------------------------------------------------------------------------------------------------------

std::uint32_t Mapping::cull() noexcept {
    cursor_ = map_->cull_points(tracking_->frame(), cursor_, kCullChunk);
    if (cursor_ == 0) {
        find_neighbours();
        enter(Stage::kTriangulate);
    }
    return kCullChunk / 16;
}

void Mapping::find_neighbours() noexcept {
    std::uint32_t best[kNeighboursMax] = {};
    neighbour_count_ = map_->best_covisible(keyframe_.slot(), best, configuration_->mapping.shared_min);
    for (std::uint32_t i = 0; i < neighbour_count_; ++i) neighbours_[i] = map_->keyframes().handle_of(best[i]);
}

std::uint32_t Mapping::triangulate() noexcept {
    // One feature with one neighbour a piece; those that need nothing are passed over.
    const std::span<const Observation> here = map_->observations(keyframe_);
    std::uint32_t passed = 0;
    const std::uint32_t with =
        configuration_->mapping.is_triangulating ? configuration_->mapping.triangulation_keyframes : 0U;
    while (other_ < std::min(neighbour_count_, with)) {
        const Handle<Keyframe> other = neighbours_[other_];
        if (map_->keyframes().find(other) != nullptr) {
            while (cursor_ < here.size()) {
                const std::uint32_t feature = cursor_++;
                ++passed;
                if (here[feature].var_z >= 0 || map_->points().find(here[feature].point) != nullptr) continue;
                return 1 + passed / 16 + triangulate_feature(feature, other);
            }
        }
        cursor_ = 0;
        ++other_;
    }
    enter(Stage::kFuse);
    return 1 + passed / 16;
}

std::uint32_t Mapping::triangulate_feature(std::uint32_t feature, Handle<Keyframe> other) noexcept {
    const Keyframe& keyframe = *map_->keyframes().find(keyframe_);
    const Observation& mine = map_->observations(keyframe_)[feature];
    const Descriptor& descriptor = map_->descriptors(keyframe_)[feature];
    const std::span<const Observation> there = map_->observations(other);
    const std::span<const Descriptor> descriptors = map_->descriptors(other);
    const SE3& world_from_other = map_->keyframes().find(other)->world_from_camera;
    const SE3 other_from_here = world_from_other.inverse() * keyframe.world_from_camera;
    const Vector3 ray(static_cast<double>(mine.normalised_x), static_cast<double>(mine.normalised_y), 1.0);
    const Vector3 turned = other_from_here.rotation * ray;
    const Vector3 line = other_from_here.translation.cross(turned);
    const double length2 = line.x() * line.x() + line.y() * line.y();
    // Most are passed over at the first look: 32 of them take a unit's time (bench_slices --all-stages).
    const auto units = static_cast<std::uint32_t>(there.size() / 32);
    if (!(length2 > kBaselineMin2)) return units;
    std::uint32_t best = configuration_->matching.hamming_wide_max + 1;
    std::uint32_t second = 257;
    std::uint32_t best_feature = kNone;
    std::uint32_t compared = 0;
    for (std::uint32_t i = 0; i < there.size(); ++i) {
        const Observation& o = there[i];
        if (o.var_z >= 0 || map_->points().find(o.point) != nullptr) continue;
        if (o.level + 1 < mine.level || mine.level + 1 < o.level) continue;
        const double off =
            line.x() * static_cast<double>(o.normalised_x) + line.y() * static_cast<double>(o.normalised_y) + line.z();
        if (off * off > configuration_->mapping.triangulation_chi2_max * var_pixel(o.level) * length2) continue;
        const std::uint32_t distance = hamming_distance(descriptor, descriptors[i]);
        ++compared;
        if (distance < best) {
            second = best;
            best = distance;
            best_feature = i;
        } else if (distance < second) {
            second = distance;
        }
    }
    const std::uint32_t spent = units + compared / 32;
    if (best_feature == kNone || static_cast<double>(best) > configuration_->matching.ratio_max * second) return spent;
    const Observation& theirs = there[best_feature];
    const Vector3 ray_there(static_cast<double>(theirs.normalised_x), static_cast<double>(theirs.normalised_y), 1.0);
    const double cosine = turned.dot(ray_there) / std::sqrt(turned.squaredNorm() * ray_there.squaredNorm());
    if (!(cosine > 0.0 && cosine < configuration_->mapping.parallax_cosine_max)) return spent;
    // Depths a, b with a turned + t = b ray_there, by least squares.
    const Vector3 t = other_from_here.translation;
    const double uu = turned.squaredNorm();
    const double vv = ray_there.squaredNorm();
    const double uv = turned.dot(ray_there);
    const double determinant = uu * vv - uv * uv;
    if (!(determinant > kDeterminantMin)) return spent;
    const double ut = turned.dot(t);
    const double vt = ray_there.dot(t);
    const double a = (uv * vt - vv * ut) / determinant;
    const double b = (uu * vt - uv * ut) / determinant;
    if (!(a > configuration_->depth.z_min_m && b > configuration_->depth.z_min_m && a < kFarthest_m)) return spent;
    const Vector3 in_here = ray * a;
    const Vector3 in_other = other_from_here * in_here;
    if (in_other.z() < configuration_->depth.z_min_m) return spent;
    const double dx = in_other.x() / in_other.z() - ray_there.x();
    const double dy = in_other.y() / in_other.z() - ray_there.y();
    if (dx * dx + dy * dy > configuration_->mapping.chi2_max_pixel * var_pixel(theirs.level)) return spent;
    // Depth from the parallax: sigma_z = z sigma sqrt(2) / sin(parallax).
    const double variance = var_pixel(std::max(mine.level, theirs.level));
    const double var_z = 2.0 * a * a * variance / (1.0 - cosine * cosine);
    const double sigma_max = configuration_->mapping.triangulation_sigma_factor * configuration_->depth.sigma_max_m;
    if (var_z > sigma_max * sigma_max) return spent;
    const Result<Handle<MapPoint>> taken = map_->add_point();
    if (!taken.is_ok()) return spent;
    MapPoint& point = *map_->points().find(taken.value());
    store(keyframe.world_from_camera * in_here, point.world);
    store(vector_of(point.world), point.anchor);
    point.var_z = var_z;
    point.var_lateral = variance * a * a;
    point.anchor_var_z = point.var_z;
    point.anchor_var_lateral = point.var_lateral;
    point.descriptor = descriptor;
    point.angle_rad = mine.angle_rad;
    point.created_ns = keyframe.time_ns;
    point.anchor_ns = keyframe.time_ns;
    point.last_seen_frame = keyframe.frame;
    point.distance_m = static_cast<float>(a);
    point.level = mine.level;
    point.weight_tenths = static_cast<std::uint8_t>(configuration_->weights.start);
    point.is_suspect = configuration_->weights.start < configuration_->weights.eligible;
    point.seen = static_cast<std::uint16_t>(map_->parameters().seen_min);  // two pictures agree on it
    static_cast<void>(map_->link(keyframe_, feature, taken.value()));
    static_cast<void>(map_->link(other, best_feature, taken.value()));
    tracking_->local_map().add(taken.value().slot());
    ++statistics_.points_triangulated;
    return spent;
}

void Mapping::build_grid(Handle<Keyframe> keyframe) noexcept {
    keypoints_.clear();
    for (const Observation& o : map_->observations(keyframe)) {
        Keypoint keypoint;
        keypoint.x = o.x;
        keypoint.y = o.y;
        keypoint.level = o.level;
        STILLMESH_CHECK(keypoints_.push(keypoint));
    }
    grid_.build(camera_.width, camera_.height, keypoints_.span());
    grid_keyframe_ = keyframe;
}

std::uint32_t Mapping::fuse() noexcept {
    // Pairs: the neighbours' points into the new keyframe, then its points into theirs.
    const std::uint32_t with =
        configuration_->mapping.is_fusing ? std::min(neighbour_count_, configuration_->mapping.fusion_keyframes) : 0U;
    while (other_ < 2 * with) {
        const Handle<Keyframe> neighbour = neighbours_[other_ % with];
        const Handle<Keyframe> source = other_ < with ? neighbour : keyframe_;
        const Handle<Keyframe> target = other_ < with ? keyframe_ : neighbour;
        if (map_->keyframes().find(neighbour) == nullptr || cursor_ >= map_->observations(source).size()) {
            cursor_ = 0;
            ++other_;
            continue;
        }
        if (!(grid_keyframe_ == target)) {
            build_grid(target);
            return 1 + static_cast<std::uint32_t>(keypoints_.size()) / 8;
        }
        const std::span<const Observation> seen = map_->observations(source);
        std::uint32_t units = 1;
        for (std::uint32_t i = 0; i < kFuseChunk && cursor_ < seen.size(); ++i) {
            units += fuse_point(seen[cursor_++].point, target);
        }
        return units;
    }
    enter(Stage::kChoose);
    return 1;
}

std::uint32_t Mapping::fuse_point(Handle<MapPoint> handle, Handle<Keyframe> target) noexcept {
    const MapPoint* const point = map_->points().find(handle);
    if (point == nullptr || point->is_suspect || map_->is_observed_by(handle.slot(), target.slot())) return 0;
    const SE3 camera_from_world = map_->keyframes().find(target)->world_from_camera.inverse();
    const Vector3 q = camera_from_world * vector_of(point->world);
    if (q.z() < configuration_->depth.z_min_m) return 0;
    const Vector2 n(q.x() / q.z(), q.y() / q.z());
    if (n.squaredNorm() > kTangentMax2) return 0;
    const Vector2 pixel = distort_to_pixel(camera_, n);
    if (!(pixel.x() >= 0 && pixel.y() >= 0 && pixel.x() < camera_.width && pixel.y() < camera_.height)) return 1;
    const std::span<const Observation> there = map_->observations(target);
    const std::span<const Descriptor> descriptors = map_->descriptors(target);
    const double noise_z = tracking_->noise_depth();
    const MappingParameters& p = configuration_->mapping;
    std::uint32_t best = p.fusion_hamming_max + 1;
    std::uint32_t best_feature = kNone;
    const double ratio = static_cast<double>(point->distance_m) / q.z() * pixel_noise_.scale(point->level);
    grid_.visit_near(pixel.x(), pixel.y(), p.fusion_radius_px * ratio, [&](std::uint32_t i) {
        const Observation& o = there[i];
        const double scale = pixel_noise_.scale(o.level);
        if (scale > p.fusion_scale_factor * ratio || ratio > p.fusion_scale_factor * scale) return;
        const double dx = static_cast<double>(o.x) - pixel.x();
        const double dy = static_cast<double>(o.y) - pixel.y();
        const double radius = p.fusion_radius_px * scale;
        if (dx * dx + dy * dy > radius * radius) return;
        if (o.var_z >= 0) {
            const double dz = static_cast<double>(o.z_m) - q.z();
            if (dz * dz > p.fusion_depth_chi2_max * noise_z * (static_cast<double>(o.var_z) + point->var_z)) return;
        }
        const std::uint32_t distance = hamming_distance(descriptors[i], point->descriptor);
        if (distance >= best) return;
        best = distance;
        best_feature = i;
    });
    if (best_feature == kNone) return 2;
    const Handle<MapPoint> rival = there[best_feature].point;
    const MapPoint* const other = map_->points().find(rival);
    if (other == nullptr) {
        static_cast<void>(map_->link(target, best_feature, handle));
        ++statistics_.observations_found;
        return 4;
    }
    if (other->is_suspect) return 2;
    // The same place, as far as the two are known?
    const Vector3 there_q = camera_from_world * vector_of(other->world);
    if (there_q.z() < configuration_->depth.z_min_m) return 2;
    const double dz = there_q.z() - q.z();
    const double dx = (there_q.x() / there_q.z() - n.x()) * q.z();
    const double dy = (there_q.y() / there_q.z() - n.y()) * q.z();
    const double var_z = noise_z * (point->var_z + other->var_z) + kVarianceMin_m2;
    const double var_lateral = point->var_lateral + other->var_lateral;
    if (dz * dz / var_z + (dx * dx + dy * dy) / var_lateral > configuration_->region.point_chi2_max) return 2;
    const bool is_older = point->observers > other->observers ||
                          (point->observers == other->observers && point->created_ns <= other->created_ns);
    const Handle<MapPoint> kept = is_older ? handle : rival;
    const Handle<MapPoint> gone = is_older ? rival : handle;
    // Where tracking has matched it in this very frame, correspondences name its slot: it goes with a later keyframe.
    if (map_->points().find(gone)->observers > kFuseObserversMax) return 2;
    return 4 + map_->fuse(kept, gone) / 64;
}

// --- adjustment ------------------------------------------------------------------------------------------------------

std::uint32_t Mapping::choose_window() noexcept {
    find_neighbours();
    adjustment_.begin();
    problem_keyframe_count_ = problem_point_count_ = problem_observation_count_ = 0;
    const AdjustmentSizes limits = sizes(limits_);
    const std::uint32_t free_max = std::min(limits.free_keyframes_max, configuration_->mapping.window_keyframes);
    std::uint32_t units = 0;
    readout_s_ = map_->readout_s();
    const auto take_in = [&](Handle<Keyframe> handle, bool is_fixed) {
        if (map_->carry_observations(handle, camera_.height)) {
            units += static_cast<std::uint32_t>(map_->observations(handle).size()) / 4;
        }
        ProblemKeyframe& in = problem_keyframes_[problem_keyframe_count_];
        in.handle = handle;
        in.world_from_camera = map_->keyframes().find(handle)->world_from_camera;
        in.is_fixed = is_fixed;
        ++problem_keyframe_count_;
    };
    take_in(keyframe_, false);
    const std::int64_t settled_ns = map_->keyframes().find(keyframe_)->time_ns -
                                    static_cast<std::int64_t>(configuration_->mapping.settled_s * kSecond_ns);
    for (std::uint32_t i = 0; i < neighbour_count_ && problem_keyframe_count_ < free_max; ++i) {
        const Keyframe* const neighbour = map_->keyframes().find(neighbours_[i]);
        // Those of an earlier visit hold still: adjusted to every later one the map would wander off with the years.
        if (neighbour == nullptr || neighbour->time_ns < settled_ns) continue;
        take_in(neighbours_[i], false);
    }
    free_count_ = problem_keyframe_count_;
    // Points of the free keyframes that two of all keyframes see, newest keyframe first; who else sees them.
    std::fill(counts_.begin(), counts_.end(), std::uint16_t{0});
    std::uint32_t newest_point_count = 0;
    for (std::uint32_t k = 0; k < free_count_; ++k) {
        const std::span<const Observation> seen = map_->observations(problem_keyframes_[k].handle);
        units += static_cast<std::uint32_t>(seen.size()) / 8;
        for (const Observation& o : seen) {
            if (problem_point_count_ == problem_points_.size()) break;
            const MapPoint* const point = map_->points().find(o.point);
            if (point == nullptr || point->is_suspect || point->observers < 2) continue;
            if (problem_index_[o.point.slot()] != 0) continue;
            ProblemPoint& in = problem_points_[problem_point_count_++];
            in.handle = o.point;
            store(vector_of(point->world), in.world);
            problem_index_[o.point.slot()] = problem_point_count_;
            map_->visit_observers(o.point.slot(), [&](std::uint32_t slot) { ++counts_[slot]; });
        }
        if (k == 0) newest_point_count = problem_point_count_;
    }
    for (std::uint32_t k = 0; k < free_count_; ++k) counts_[problem_keyframes_[k].handle.slot()] = 0;
    for (std::uint32_t k = 0; k < limits.fixed_keyframes_max; ++k) {
        std::uint32_t best = 0;
        for (std::uint32_t slot = 1; slot < counts_.size(); ++slot) {
            if (counts_[slot] > counts_[best]) best = slot;
        }
        if (counts_[best] < configuration_->mapping.fixed_shared_min) break;
        counts_[best] = 0;
        take_in(map_->keyframes().handle_of(best), true);
    }
    // Somebody must hold still: the oldest.
    if (problem_keyframe_count_ == free_count_) {
        std::uint32_t oldest = 0;
        const auto frame_of = [&](std::uint32_t k) {
            return map_->keyframes().find(problem_keyframes_[k].handle)->frame;
        };
        for (std::uint32_t k = 1; k < free_count_; ++k) {
            if (frame_of(k) < frame_of(oldest)) oldest = k;
        }
        problem_keyframes_[oldest].is_fixed = true;
    }
    // A few points far away fit a camera that stands aside and looks askance as well, and tracking follows the newest:
    // its own points have to be enough.
    const bool is_worth_it = configuration_->mapping.is_adjusting && problem_keyframe_count_ >= 2 &&
                             newest_point_count >= configuration_->mapping.adjusted_points_min;
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
        const std::span<const Observation> seen = map_->observations(handle);
        const double noise_pixel = tracking_->noise_pixel();
        const double noise_depth = tracking_->noise_depth();
        // A camera that turns while it waits for its depth measures past the feature, as in tracking; the expected lag
        // stands for that of the frame.
        const Keyframe* const keyframe = map_->keyframes().find(handle);
        const double turn_rad_s = keyframe != nullptr ? std::sqrt(keyframe->speed.tail<3>().squaredNorm()) : 0.0;
        const double slip_per_m =
            turn_rad_s * configuration_->region.colour_depth_lag_s * configuration_->prediction.slip_share;
        for (std::uint32_t i = 0; i < seen.size(); ++i) {
            const Observation& o = seen[i];
            const MapPoint* const point = map_->points().find(o.point);
            if (point == nullptr || problem_index_[o.point.slot()] == 0) continue;
            const std::uint32_t index = problem_index_[o.point.slot()] - 1;
            if (!(problem_points_[index].handle == o.point)) continue;
            if (problem_observation_count_ == problem_observations_.size()) break;
            AdjustmentObservation in;
            in.keyframe = problem_keyframes_[k].index;
            in.point = index;
            in.x = static_cast<double>(o.normalised_x);
            in.y = static_cast<double>(o.normalised_y);
            in.var_pixel = var_pixel(o.level) * noise_pixel / o.looks;
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
    options.chi2_max_pixel = configuration_->mapping.chi2_max_pixel;
    options.chi2_max_depth = configuration_->mapping.chi2_max_depth;
    options.iterations_max[0] = configuration_->mapping.first_iterations_max;
    options.iterations_max[1] = configuration_->mapping.second_iterations_max;
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
    return limits_.map_points_max / 16 + problem_observation_count_ / 8;
}

void Mapping::correct_keyframes() noexcept {
    std::fill(corrections_.begin(), corrections_.end(), Correction{});
    std::uint64_t newest = 0;
    Pool<Keyframe>& keyframes = map_->keyframes();
    for (std::uint32_t k = 0; k < problem_keyframe_count_; ++k) {
        const ProblemKeyframe& in = problem_keyframes_[k];
        Keyframe* const keyframe = keyframes.find(in.handle);
        if (keyframe == nullptr) continue;
        newest = std::max(newest, keyframe->frame);
        if (in.is_fixed) continue;
        const SE3& pose = adjustment_.pose(in.index);
        corrections_[in.handle.slot()] = {transform_between(pose, in.world_from_camera), true};
        // What was learnt of the readout meanwhile stays.
        keyframe->world_from_camera = pose * se3_exp(keyframe->pose_by_readout * (map_->readout_s() - readout_s_));
        for (int i = 0; i < 3; ++i) map_->note_change(pose.translation(i));
    }
    // Newer ones, oldest first, so that each finds its parent corrected.
    for (;;) {
        std::uint32_t next = kNone;
        for (std::uint32_t slot = 0; slot < keyframes.slots_count(); ++slot) {
            if (!keyframes.is_taken(slot) || keyframes.at(slot).frame <= newest) continue;
            if (next == kNone || keyframes.at(slot).frame < keyframes.at(next).frame) next = slot;
        }
        if (next == kNone) break;
        Keyframe& keyframe = keyframes.at(next);
        newest = keyframe.frame;
        if (keyframe.parent.is_null() || !corrections_[keyframe.parent.slot()].is_any) continue;
        corrections_[next] = corrections_[keyframe.parent.slot()];
        keyframe.world_from_camera = corrections_[next].world_from_world * keyframe.world_from_camera;
        renormalise(keyframe.world_from_camera.rotation);
        for (int i = 0; i < 3; ++i) map_->note_change(keyframe.world_from_camera.translation(i));
    }
    const Handle<Keyframe> last = map_->recent_keyframe(0);
    if (!last.is_null() && corrections_[last.slot()].is_any) {
        tracking_->follow(corrections_[last.slot()].world_from_world);
    }
}

void Mapping::correct_points() noexcept {
    Pool<MapPoint>& points = map_->points();
    for (std::uint32_t slot = 0; slot < points.slots_count(); ++slot) {
        if (!points.is_taken(slot)) continue;
        MapPoint& point = points.at(slot);
        const bool follows = !point.reference.is_null() && corrections_[point.reference.slot()].is_any;
        const SE3& correction = corrections_[follows ? point.reference.slot() : 0].world_from_world;
        const std::uint32_t index = problem_index_[slot];
        const bool is_adjusted = index != 0 && problem_points_[index - 1].handle == points.handle_of(slot) &&
                                 !point.is_suspect && adjustment_.is_point_used(index - 1);
        if (is_adjusted) {
            // What tracking has learnt meanwhile stays.
            const Vector3 learnt = vector_of(point.world) - vector_of(problem_points_[index - 1].world);
            store(adjustment_.point(index - 1) + learnt, point.world);
            for (const double w : point.world) map_->note_change(w);
        } else if (follows) {
            store(correction * vector_of(point.world), point.world);
        }
        if (follows) store(correction * vector_of(point.anchor), point.anchor);
    }
}

void Mapping::drop_outliers() noexcept {
    for (std::uint32_t i = 0; i < problem_observation_count_; ++i) {
        if (!adjustment_.is_outlier(i)) continue;
        const ProblemObservation& in = problem_observations_[i];
        const Handle<Keyframe> handle = problem_keyframes_[in.keyframe].handle;
        if (map_->keyframes().find(handle) == nullptr) continue;
        const Handle<MapPoint> seen = map_->observations(handle)[in.feature].point;
        const MapPoint* const point = map_->points().find(seen);
        if (point == nullptr || problem_index_[seen.slot()] == 0) continue;
        if (!(problem_points_[problem_index_[seen.slot()] - 1].handle == seen)) continue;
        if (point->observers < 2) continue;  // what tracking still follows is not lost for one look
        map_->unlink(handle, in.feature);
        ++statistics_.observations_dropped;
    }
}

// --- room ------------------------------------------------------------------------------------------------------------

std::uint32_t Mapping::drop_redundant() noexcept {
    // One neighbour a piece; the newest keyframes have not had the time to prove themselves. While the pool is roomy
    // nobody goes: more looks at a place make it surer (measured, docs/mapping.md).
    const Pool<Keyframe>& pool = map_->keyframes();
    const bool is_roomy = pool.size() * 1000 <= pool.capacity() * std::size_t{configuration_->mapping.roomy_permille};
    if (cursor_ >= neighbour_count_ || is_roomy || !configuration_->mapping.is_culling) {
        enter(Stage::kEvict);
        return 1;
    }
    const Handle<Keyframe> handle = neighbours_[cursor_++];
    const Keyframe* const keyframe = map_->keyframes().find(handle);
    if (keyframe == nullptr || keyframe->parent.is_null()) return 1;
    if (handle == map_->recent_keyframe(0) || handle == map_->recent_keyframe(1)) return 1;
    if (map_->is_redundant(handle)) map_->release_redundant(handle);
    return 1 + limits_.features_max / 2;
}

std::uint32_t Mapping::evict() noexcept {
    const Pool<Keyframe>& keyframes = map_->keyframes();
    const Pool<MapPoint>& points = map_->points();
    const std::size_t keyframes_spare =
        std::max<std::size_t>(1, keyframes.capacity() * configuration_->mapping.spare_keyframes_permille / 1000);
    if (keyframes.capacity() - keyframes.size() < keyframes_spare && cursor_ < keyframes_spare) {
        ++cursor_;
        if (map_->evict_keyframe(tracking_->local_map().keyframes())) {
            const std::uint32_t compared = std::min(limits_.keyframes_max, Map::kCrowdedCandidates);
            return 1 + limits_.features_max / 2 + 2 * limits_.keyframes_max + compared * compared / 4;
        }
    }
    const std::size_t points_spare = std::min<std::size_t>(
        limits_.features_max, static_cast<std::size_t>(std::uint64_t{configuration_->mapping.spare_points_permille} *
                                                       points.capacity() / 1000));
    const std::size_t free = points.capacity() - points.size();
    stage_ = Stage::kIdle;
    if (free >= points_spare) return 1;
    static_cast<void>(map_->make_room_for_points(static_cast<std::uint32_t>(points_spare - free), tracking_->frame(),
                                                 tracking_->local_map().spared()));
    return limits_.map_points_max / 16;
}

void Mapping::fill(EngineStatistics& statistics) const noexcept {
    statistics.mapping = statistics_;
}

}  // namespace stillmesh
