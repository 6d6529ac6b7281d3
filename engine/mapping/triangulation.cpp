#include "engine/mapping/triangulation.hpp"

#include <algorithm>
#include <cmath>
#include <span>

#include "engine/features/hamming.hpp"

namespace stillmesh {
namespace {

// Guards of the arithmetic: a baseline (squared) too short for an epipolar line, rays too parallel to meet, and where
// they meet too far for any depth camera.
constexpr double kBaselineMin2 = 1e-12;
constexpr double kDeterminantMin = 1e-9;
constexpr double kFarthest_m = 100.0;
constexpr std::uint32_t kNone = 0xffffffffU;

Vector3 ray_of(const Observation& o) noexcept {
    return {static_cast<double>(o.normalised_x), static_cast<double>(o.normalised_y), 1.0};
}

struct Partner {
    std::uint32_t feature = kNone;
    std::uint32_t compared = 0;
};
// The feature of `other` that is alike, of those near the epipolar `line` (length squared `length2`) without a point.
Partner find_partner(const Map& map, const Observation& mine, const Descriptor& descriptor, Handle<Keyframe> other,
                     const Vector3& line, double length2, const Parameters& configuration,
                     const PixelNoise& pixel_noise) noexcept {
    const std::span<const Observation> there = map.observations(other);
    const std::span<const Descriptor> descriptors = map.descriptors(other);
    Partner out;
    std::uint32_t best = configuration.matching.hamming_wide_max + 1;
    std::uint32_t second = 257;
    for (std::uint32_t i = 0; i < there.size(); ++i) {
        const Observation& o = there[i];
        if (o.var_z >= 0 || map.points().find(o.point) != nullptr) continue;
        if (o.level + 1 < mine.level || mine.level + 1 < o.level) continue;
        const double off =
            line.x() * static_cast<double>(o.normalised_x) + line.y() * static_cast<double>(o.normalised_y) + line.z();
        if (off * off > configuration.mapping.triangulation_chi2_max * pixel_noise.var(o.level) * length2) continue;
        const std::uint32_t distance = hamming_distance(descriptor, descriptors[i]);
        ++out.compared;
        if (distance < best) {
            second = best;
            best = distance;
            out.feature = i;
        } else if (distance < second) {
            second = distance;
        }
    }
    if (static_cast<double>(best) > configuration.matching.ratio_max * second) out.feature = kNone;
    return out;
}

struct Meeting {
    bool is_any = false;
    double z_m = 0;    // along the ray here
    double var_z = 0;  // by the parallax
};
Meeting meet(const SE3& other_from_here, const Observation& mine, const Observation& theirs,
             const Parameters& configuration, const PixelNoise& pixel_noise) noexcept {
    const Vector3 ray = ray_of(mine);
    const Vector3 turned = other_from_here.rotation * ray;
    const Vector3 ray_there = ray_of(theirs);
    const double cosine = turned.dot(ray_there) / std::sqrt(turned.squaredNorm() * ray_there.squaredNorm());
    if (!(cosine > 0.0 && cosine < configuration.mapping.parallax_cosine_max)) return {};
    // Depths a, b with a turned + t = b ray_there, by least squares.
    const Vector3 t = other_from_here.translation;
    const double uu = turned.squaredNorm();
    const double vv = ray_there.squaredNorm();
    const double uv = turned.dot(ray_there);
    const double determinant = uu * vv - uv * uv;
    if (!(determinant > kDeterminantMin)) return {};
    const double ut = turned.dot(t);
    const double vt = ray_there.dot(t);
    const double a = (uv * vt - vv * ut) / determinant;
    const double b = (uu * vt - uv * ut) / determinant;
    const double z_min_m = configuration.depth.z_min_m;
    if (!(a > z_min_m && b > z_min_m && a < kFarthest_m)) return {};
    const Vector3 in_other = other_from_here * (ray * a);
    if (in_other.z() < z_min_m) return {};
    const double dx = in_other.x() / in_other.z() - ray_there.x();
    const double dy = in_other.y() / in_other.z() - ray_there.y();
    if (dx * dx + dy * dy > configuration.mapping.chi2_max_pixel * pixel_noise.var(theirs.level)) return {};
    // Depth from the parallax: sigma_z = z sigma sqrt(2) / sin(parallax).
    const double variance = pixel_noise.var(std::max(mine.level, theirs.level));
    const double var_z = 2.0 * a * a * variance / (1.0 - cosine * cosine);
    const double sigma_max = configuration.mapping.triangulation_sigma_factor * configuration.depth.sigma_max_m;
    return {!(var_z > sigma_max * sigma_max), a, var_z};
}

}  // namespace

Triangulation triangulate(Map& map, Handle<Keyframe> here, std::uint32_t feature, Handle<Keyframe> other,
                          const Parameters& configuration, const PixelNoise& pixel_noise) noexcept {
    const Keyframe& keyframe = *map.keyframes().find(here);
    const Observation& mine = map.observations(here)[feature];
    const Descriptor& descriptor = map.descriptors(here)[feature];
    const SE3 other_from_here = map.keyframes().find(other)->world_from_camera.inverse() * keyframe.world_from_camera;
    const Vector3 line = other_from_here.translation.cross(other_from_here.rotation * ray_of(mine));
    const double length2 = line.x() * line.x() + line.y() * line.y();
    Triangulation out;
    // Most are passed over at the first look: 32 of them take a unit's time (bench_slices --all-stages).
    out.units = static_cast<std::uint32_t>(map.observations(other).size() / 32);
    if (!(length2 > kBaselineMin2)) return out;
    const Partner partner = find_partner(map, mine, descriptor, other, line, length2, configuration, pixel_noise);
    out.units += partner.compared / 32;
    if (partner.feature == kNone) return out;
    const Observation& theirs = map.observations(other)[partner.feature];
    const Meeting meeting = meet(other_from_here, mine, theirs, configuration, pixel_noise);
    if (!meeting.is_any) return out;
    const Result<Handle<MapPoint>> taken = map.add_point();
    if (!taken.is_ok()) return out;
    out.point = taken.value();
    MapPoint& point = *map.points().find(out.point);
    store(keyframe.world_from_camera * (ray_of(mine) * meeting.z_m), point.world);
    store(vector_of(point.world), point.anchor);
    point.var_z = meeting.var_z;
    point.var_lateral = pixel_noise.var(std::max(mine.level, theirs.level)) * meeting.z_m * meeting.z_m;
    point.anchor_var_z = point.var_z;
    point.anchor_var_lateral = point.var_lateral;
    point.descriptor = descriptor;
    point.angle_rad = mine.angle_rad;
    point.created_ns = keyframe.time_ns;
    point.anchor_ns = keyframe.time_ns;
    point.last_seen_frame = keyframe.frame;
    point.agreed_way_m = keyframe.way_m;
    point.distance_m = static_cast<float>(meeting.z_m);
    point.level = mine.level;
    point.weight_tenths = static_cast<std::uint8_t>(configuration.weights.start);
    point.is_suspect = configuration.weights.start < configuration.weights.eligible;
    point.seen = static_cast<std::uint16_t>(map.parameters().seen_min);  // two pictures agree on it
    static_cast<void>(map.link(here, feature, out.point));
    static_cast<void>(map.link(other, partner.feature, out.point));
    return out;
}

}  // namespace stillmesh
