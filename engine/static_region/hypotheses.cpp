#include "engine/static_region/hypotheses.hpp"

#include <algorithm>

#include "engine/mesh/predicates.hpp"
#include "engine/pose/agreeing.hpp"
#include "engine/pose/pose_optimiser.hpp"
#include "engine/pose/ransac.hpp"

namespace stillmesh {
namespace {

// In squared mesh units; triangles are counter-clockwise.
double twice_area(const Mesh& mesh, const MeshTriangle& triangle) noexcept {
    return stillmesh::twice_area(mesh.vertices[triangle.vertex[0]], mesh.vertices[triangle.vertex[1]],
                                 mesh.vertices[triangle.vertex[2]]);
}

// The squared deviation of a pose from the one expected, translation and rotation in their sigmas.
double deviation2(const RegionContext& context, const SE3& expected, const SE3& world_from_camera) noexcept {
    const SE3 off = expected.inverse() * world_from_camera;
    const double sigma_m = context.prediction_sigma_m / context.hint.sharpness_m;
    const double angle = rotation_angle(off.rotation) / context.prediction_sigma_rad * context.hint.sharpness_rad;
    return off.translation.squaredNorm() / (sigma_m * sigma_m) + angle * angle;
}

}  // namespace

double support_needed(const RegionInput& input, const SE3& expected, const SE3& world_from_camera) noexcept {
    const double sigmas = input.configuration.region.prior_sigmas;
    return 1.0 + deviation2(input.context, expected, world_from_camera) / (sigmas * sigmas);
}

void Hypotheses::create(Arena& arena, const Limits& limits) noexcept {
    const std::uint32_t n = limits.features_max;
    is_inlier_ = arena.array<std::uint8_t>(n);
    explained_by_ = arena.array<std::uint16_t>(n);
}

void Hypotheses::clear() noexcept {
    motions_.clear();
    hypotheses_.clear();
    proposed_ = 0;
    iterations_ = 0;
}

void Hypotheses::propose(const RegionInput& input, Random& random) noexcept {
    clear();
    std::fill_n(explained_by_.begin(), input.correspondences.size(), std::uint16_t{0});
    const bool is_enabled = input.configuration.region.is_enabled;
    if (is_enabled) iterations_ += motions_.fit(input, random);
    if (input.context.has_prediction) propose_expected(input);
    propose_over_all(input, random);
    if (is_enabled) propose_groups(input);
    if (is_enabled) propose_left_over(input, random);
    proposed_ = hypotheses_.size();
    if (is_enabled && input.context.rival_frames > 0) add_rival(input);
}

void Hypotheses::propose_expected(const RegionInput& input) noexcept {
    const RegionParameters& region = input.configuration.region;
    const SE3& expected = input.context.world_from_camera_predicted;
    const PoseFit fit = optimise_pose(input.correspondences, input.weighted, expected, region.point_chi2_max,
                                      input.configuration.pose.coarse_passes_max);
    add(input, fit.is_valid ? fit.world_from_camera : expected, region.wide_factor);
    // All points together may pull it to a body that fills the picture; what is hinted at is asked as it is, too.
    if (input.context.hint.is_any) add(input, expected, region.wide_factor);
}

void Hypotheses::propose_over_all(const RegionInput& input, Random& random) noexcept {
    const RansacOptions options =
        ransac_options(input.configuration, input.configuration.pose.coarse_factor, input.context.inlier_ratio);
    const RansacResult result = ransac_pose(input.correspondences, input.weighted, nullptr, options, random);
    iterations_ += result.iterations;
    if (result.is_valid) add(input, result.world_from_camera, input.configuration.region.wide_factor);
}

void Hypotheses::propose_groups(const RegionInput& input) noexcept {
    for (std::uint16_t g = 0; g < motions_.count(); ++g) {
        const SE3* const motion = motions_.motion_of(g);
        if (motion != nullptr && hypotheses_.size() < kHypothesesMax) add(input, *motion, 1.0);
    }
}

// What agrees with no hypothesis yet may have a motion of its own, however few its points are: RANSAC over all finds
// the most points, and those may be the crowd.
void Hypotheses::propose_left_over(const RegionInput& input, Random& random) noexcept {
    const RegionParameters& region = input.configuration.region;
    const PoseParameters& pose = input.configuration.pose;
    RansacOptions options = ransac_options(input.configuration, pose.coarse_factor, pose.inlier_ratio_start);
    const std::uint32_t round_iterations = options.iterations_max;
    for (std::uint32_t round = 0; round < region.left_over_rounds; ++round) {
        if (hypotheses_.size() == kHypothesesMax || iterations_ >= pose.coarse_total_max) return;
        input.scratch.clear();
        for (const std::uint16_t i : input.weighted) {
            if (explained_by_[i] == 0) STILLMESH_CHECK(input.scratch.push(i));
        }
        if (input.scratch.size() < 2 * region.group_points_min) return;
        options.iterations_max = std::min(round_iterations, pose.coarse_total_max - iterations_);
        const RansacResult result = ransac_pose(input.correspondences, input.scratch.span(), nullptr, options, random);
        iterations_ += result.iterations;
        if (!result.is_valid || result.inliers < region.group_points_min) return;
        add(input, result.world_from_camera, region.wide_factor);
    }
}

// What contradicted the choice before goes on to be asked, found by RANSAC or not. It is not one to choose: chosen as
// well, poses of two who sway went astray as often (sitting_rpy:19, six seeds of RANSAC).
void Hypotheses::add_rival(const RegionInput& input) noexcept {
    add(input, input.context.world_from_camera_rival, input.configuration.region.wide_factor);
}

// Refined on what agrees with it within `reach` times the threshold, so that hypotheses are compared at their best.
void Hypotheses::add(const RegionInput& input, const SE3& world_from_camera, double reach) noexcept {
    const RegionParameters& region = input.configuration.region;
    choose_agreeing(input.correspondences, world_from_camera, reach * region.point_chi2_max,
                    region.wide_factor * (reach * region.point_chi2_max), input.scratch);
    const PoseFit fit = optimise_pose(input.correspondences, input.scratch.span(), world_from_camera,
                                      region.point_chi2_max, input.configuration.pose.coarse_passes_max);
    Hypothesis scored = score(input, fit.is_valid ? fit.world_from_camera : world_from_camera);
    if (region.is_enabled && !input.context.has_past && !input.context.hint.is_whole && region.reach > 0)
        scored.surface = surface_share(input, scored.world_from_camera);
    const std::size_t bit = hypotheses_.size();
    for (std::size_t i = 0; i < input.correspondences.size(); ++i) {
        if (is_inlier_[i] != 0) explained_by_[i] = static_cast<std::uint16_t>(explained_by_[i] | 1U << bit);
    }
    STILLMESH_CHECK(hypotheses_.push(scored));
}

// Eq. 1 with weights: a point counts by what the past knows of it, and all of it as far as its group agrees.
Hypothesis Hypotheses::score(const RegionInput& input, const SE3& world_from_camera) noexcept {
    const RegionParameters& region = input.configuration.region;
    judge(input, world_from_camera);
    const Share points = points_of(input);
    const Share triangles = triangles_of(input);
    Hypothesis out;
    out.world_from_camera = world_from_camera;
    double weight_sum = region.score_points;
    double score = points.all > 0 ? region.score_points * points.agreeing / points.all : 0.0;
    if (triangles.all > 0) {
        score += triangles.agreeing / triangles.all;
        weight_sum += 1.0;
    }
    if (input.context.has_prediction) {
        out.plausibility = 1.0 / support_needed(input, input.context.world_from_camera_predicted, world_from_camera);
        score += region.prior_weight * out.plausibility;
        weight_sum += region.prior_weight;
        score *= out.plausibility;
    }
    out.score = weight_sum > 0 ? score / weight_sum : 0.0;
    return out;
}

// Of the surface in view, as far as the motion is to be expected: not the pose of its points alone, whose noise would
// speak against it where they are few and far, but the one nearest to what is expected that they leave room for.
double Hypotheses::surface_share(const RegionInput& input, const SE3& world_from_camera) const noexcept {
    const RegionParameters& region = input.configuration.region;
    const RegionContext& context = input.context;
    Share surface;
    for (std::size_t i = 0; i < input.correspondences.size(); ++i) {
        const double area = surface_of(input.correspondences[i]);
        surface.all += area;
        if (is_inlier_[i] != 0) surface.agreeing += area * motions_.agreement_of(input.groups.group_of(i));
    }
    if (!(surface.all > 0) || !context.has_prediction) return 0;
    const MotionPrior prior{context.world_from_camera_predicted, context.prediction_sigma_m,
                            context.prediction_sigma_rad};
    const PoseFit held = optimise_pose(input.correspondences, input.scratch.span(), world_from_camera,
                                       region.point_chi2_max, input.configuration.pose.coarse_passes_max, &prior);
    return surface.agreeing / surface.all /
           support_needed(input, context.world_from_camera_predicted,
                          held.is_valid ? held.world_from_camera : world_from_camera);
}

// Which correspondences agree with a pose, and how far each group does.
void Hypotheses::judge(const RegionInput& input, const SE3& world_from_camera) noexcept {
    const RegionParameters& region = input.configuration.region;
    const SE3 camera_from_world = world_from_camera.inverse();
    motions_.begin_agreement();
    for (std::size_t i = 0; i < input.correspondences.size(); ++i) {
        const double chi2 = chi2_over_time(input.correspondences[i], camera_from_world, input.configuration);
        is_inlier_[i] = chi2 <= region.point_chi2_max ? 1 : 0;
        if (input.correspondences[i].weight > 0) motions_.add_residual(input.groups.group_of(i), chi2);
    }
    motions_.end_agreement(region);
}

Hypotheses::Share Hypotheses::points_of(const RegionInput& input) const noexcept {
    Share share;
    for (std::size_t i = 0; i < input.correspondences.size(); ++i) {
        const double area = area_of(input.correspondences[i]);
        share.all += area;
        if (is_inlier_[i] != 0) share.agreeing += area * motions_.agreement_of(input.groups.group_of(i));
    }
    return share;
}

// A triangle agrees when all of it does. In square metres: what moves is close and small, what stands still is the room
// around it. (The paper counts pixels, and a person at arm's length has more of them than the wall behind.)
Hypotheses::Share Hypotheses::triangles_of(const RegionInput& input) const noexcept {
    const Mesh& mesh = input.groups.mesh();
    const auto agreement_at = [&](std::uint16_t i) { return motions_.agreement_of(input.groups.group_of(i)); };
    Share share;
    for (const MeshTriangle& triangle : mesh.triangles) {
        const std::uint16_t i = input.groups.correspondence_of(triangle.vertex[0]);
        const std::uint16_t j = input.groups.correspondence_of(triangle.vertex[1]);
        const std::uint16_t k = input.groups.correspondence_of(triangle.vertex[2]);
        const Correspondence& a = input.correspondences[i];
        const Correspondence& b = input.correspondences[j];
        const Correspondence& c = input.correspondences[k];
        const double weight = (a.weight + b.weight + c.weight) / 3.0;
        const double z = (a.p_camera.z() + b.p_camera.z() + c.p_camera.z()) / 3.0;
        const double area = weight * twice_area(mesh, triangle) * z * z;
        share.all += area;
        if (is_inlier_[i] != 0 && is_inlier_[j] != 0 && is_inlier_[k] != 0)
            share.agreeing += area * std::min({agreement_at(i), agreement_at(j), agreement_at(k)});
    }
    return share;
}

double Hypotheses::explained_share(std::span<const std::uint16_t> weighted) const noexcept {
    std::size_t explained = 0;
    const std::uint32_t proposed = (1U << proposed_) - 1U;
    for (const std::uint16_t i : weighted) explained += (explained_by_[i] & proposed) != 0 ? 1U : 0U;
    return static_cast<double>(explained) / static_cast<double>(std::max<std::size_t>(weighted.size(), 1));
}

}  // namespace stillmesh
