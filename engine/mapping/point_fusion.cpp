#include "engine/mapping/point_fusion.hpp"

#include "engine/features/hamming.hpp"

namespace stillmesh {
namespace {

constexpr double kTangentMax2 = 4.0;  // how far out (squared) a lens may see
constexpr double kVarianceMin_m2 = 1e-6;

}  // namespace

void PointFusion::create(Arena& arena, World& world) noexcept {
    world_ = &world;
    grid_.create(arena, world.limits);
    forget_target();
}

std::uint32_t PointFusion::set_target(Handle<Keyframe> keyframe) noexcept {
    const std::span<const Observation> seen = world_->map.observations(keyframe);
    grid_.build(world_->camera.width, world_->camera.height, seen);
    target_ = keyframe;
    return static_cast<std::uint32_t>(seen.size()) / 8;
}

std::uint32_t PointFusion::fuse_into(Handle<MapPoint> handle, Handle<Keyframe> keyframe) noexcept {
    if (world_->map.keyframes().find(keyframe) == nullptr) return 1;
    const std::uint32_t units = has_target(keyframe) ? 1 : 1 + set_target(keyframe);
    return units + fuse(handle);
}

std::uint32_t PointFusion::find_alike(const MapPoint& point, const Vector2& pixel, double z_m) const noexcept {
    const Map& map = world_->map;
    const std::span<const Observation> there = map.observations(target_);
    const std::span<const Descriptor> descriptors = map.descriptors(target_);
    const MatchingParameters& p = world_->parameters.matching;
    const double chi2_max = world_->parameters.region.edge_chi2_max;
    std::uint32_t best = p.hamming_wide_max + 1;
    std::uint32_t best_feature = kNone;
    const double ratio = static_cast<double>(point.distance_m) / z_m * world_->pixel_noise.scale(point.level);
    grid_.visit_near(pixel.x(), pixel.y(), p.radius_posed_px * kScaleSlack * ratio, [&](std::uint32_t i) {
        const Observation& o = there[i];
        const double scale = world_->pixel_noise.scale(o.level);
        if (scale > kScaleSlack * ratio || ratio > kScaleSlack * scale) return;
        const double dx = static_cast<double>(o.x) - pixel.x();
        const double dy = static_cast<double>(o.y) - pixel.y();
        const double radius = p.radius_posed_px * scale;
        if (dx * dx + dy * dy > radius * radius) return;
        if (o.var_z >= 0) {
            const double dz = static_cast<double>(o.z_m) - z_m;
            if (dz * dz > chi2_max * world_->noise.depth * (static_cast<double>(o.var_z) + point.var_z)) return;
        }
        const std::uint32_t distance = hamming_distance(descriptors[i], point.descriptor);
        if (distance >= best) return;
        best = distance;
        best_feature = i;
    });
    return best_feature;
}

std::uint32_t PointFusion::fuse(Handle<MapPoint> handle) noexcept {
    Map& map = world_->map;
    const MapPoint* const point = map.points().find(handle);
    if (point == nullptr || point->is_suspect || map.is_observed_by(handle.slot(), target_.slot())) return 0;
    const double z_min_m = world_->parameters.depth.z_min_m;
    const SE3 camera_from_world = map.keyframes().find(target_)->world_from_camera.inverse();
    const Vector3 q = camera_from_world * vector_of(point->world);
    if (q.z() < z_min_m) return 0;
    const Vector2 n(q.x() / q.z(), q.y() / q.z());
    if (n.squaredNorm() > kTangentMax2) return 0;
    const Vector2 pixel = distort_to_pixel(world_->camera, n);
    if (!is_in_picture(world_->camera, pixel)) return 1;
    const std::uint32_t feature = find_alike(*point, pixel, q.z());
    if (feature == kNone) return 2;
    const Handle<MapPoint> rival = map.observations(target_)[feature].point;
    const MapPoint* const other = map.points().find(rival);
    if (other == nullptr) {
        static_cast<void>(map.link(target_, feature, handle));
        ++world_->statistics.mapping.observations_found;
        return 4;
    }
    if (other->is_suspect) return 2;
    // The same place, as far as the two are known?
    const Vector3 there = camera_from_world * vector_of(other->world);
    if (there.z() < z_min_m) return 2;
    const double dz = there.z() - q.z();
    const double dx = (there.x() / there.z() - n.x()) * q.z();
    const double dy = (there.y() / there.z() - n.y()) * q.z();
    const double var_z = world_->noise.depth * (point->var_z + other->var_z) + kVarianceMin_m2;
    const double var_lateral = point->var_lateral + other->var_lateral;
    if (dz * dz / var_z + (dx * dx + dy * dy) / var_lateral > world_->parameters.region.point_chi2_max) return 2;
    const bool is_older = point->observers > other->observers ||
                          (point->observers == other->observers && point->created_ns <= other->created_ns);
    const Handle<MapPoint> kept = is_older ? handle : rival;
    const Handle<MapPoint> gone = is_older ? rival : handle;
    // Where tracking has matched it in this very frame, correspondences name its slot: it goes with a later keyframe.
    if (map.points().find(gone)->observers > kObserversMax) return 2;
    return 4 + map.fuse(kept, gone) / 64;
}

}  // namespace stillmesh
