#include "engine/static_region/static_region.hpp"

#include <algorithm>
#include <cmath>

#include "engine/base/numbers.hpp"
#include "engine/base/sort.hpp"
#include "engine/pose/pose_optimiser.hpp"
#include "engine/pose/ransac.hpp"
#include "engine/pose/residual.hpp"
#include "engine/static_region/distance_consistency.hpp"

namespace stillmesh {
namespace {

// Twice the area of a triangle, in squared mesh units.
double twice_area(const Mesh& mesh, const MeshTriangle& triangle) noexcept {
    const PixelPoint a = mesh.vertices[triangle.vertex[0]];
    const PixelPoint b = mesh.vertices[triangle.vertex[1]];
    const PixelPoint c = mesh.vertices[triangle.vertex[2]];
    const std::int64_t cross =
        static_cast<std::int64_t>(b.x - a.x) * (c.y - a.y) - static_cast<std::int64_t>(b.y - a.y) * (c.x - a.x);
    return static_cast<double>(cross < 0 ? -cross : cross);
}

// Steeper than any surface that shows features on both ends for long.
bool is_depth_step(const Correspondence& a, const Correspondence& b, const RegionParameters& region) noexcept {
    const double step = a.p_camera.z() - b.p_camera.z();
    const double across = (a.normalised - b.normalised).squaredNorm() * a.p_camera.z() * b.p_camera.z();
    return step * step > region.step_m * region.step_m && step * step > region.step_slope * region.step_slope * across;
}

// What a correspondence says about a pose, judged by the map's estimate and by where the point was first seen.
double badness(const Correspondence& c, const SE3& camera_from_world, const RegionParameters& region) noexcept {
    return std::max(chi2_of(c, camera_from_world), region.anchor_chi2_share * chi2_of_anchor(c, camera_from_world));
}

// What a feature stands for in square metres, up to a factor.
double area_of(const Correspondence& c) noexcept {
    return c.has_depth ? c.vote * c.p_camera.z() * c.p_camera.z() : 0.0;
}
constexpr double kArea_px2 = 0.5 / (kMeshUnitsPerPixel * kMeshUnitsPerPixel);

}  // namespace

void StaticRegion::create(Arena& arena, const Limits& limits) noexcept {
    const std::uint32_t n = limits.features_max;
    delaunay_.create(arena, n);
    pixels_.create(arena, n);
    correspondence_of_pixel_.create(arena, n);
    members_.create(arena, n);
    chosen_.create(arena, n);
    all_.create(arena, n);
    inliers_.create(arena, n);
    roots_.create(arena, mesh_triangles_max(n));
    first_of_vertex_ = arena.array<std::uint16_t>(n);
    parent_ = arena.array<std::uint16_t>(mesh_triangles_max(n));
    triangles_of_ = arena.array<std::uint16_t>(mesh_triangles_max(n));
    group_of_correspondence_ = arena.array<std::uint16_t>(n);
    edge_kept_ = arena.array<std::uint8_t>(mesh_edges_max(n));
    is_inlier_ = arena.array<std::uint8_t>(n);
    explained_by_ = arena.array<std::uint16_t>(n);
    groups_ = arena.array<Group>(limits.groups_max);
}

void StaticRegion::build(std::span<const Correspondence> correspondences, std::span<const Keypoint> keypoints,
                         const RegionParameters& parameters, const RegionContext& context) noexcept {
    pixels_.clear();
    correspondence_of_pixel_.clear();
    for (std::size_t i = 0; i < correspondences.size(); ++i) {
        group_of_correspondence_[i] = kNoGroup;
        if (!correspondences[i].has_depth) continue;
        const Keypoint& keypoint = keypoints[correspondences[i].feature];
        const PixelPoint pixel{
            round_clamped(static_cast<double>(keypoint.x) * kMeshUnitsPerPixel, 0, kMeshCoordinateMax),
            round_clamped(static_cast<double>(keypoint.y) * kMeshUnitsPerPixel, 0, kMeshCoordinateMax)};
        STILLMESH_CHECK(pixels_.push(pixel));
        STILLMESH_CHECK(correspondence_of_pixel_.push(static_cast<std::uint16_t>(i)));
    }
    const Status status = delaunay_.triangulate(pixels_.span());
    STILLMESH_CHECK(status == Status::kOk || status == Status::kDegenerate);
    const Mesh& mesh = delaunay_.mesh();
    for (std::size_t i = mesh.vertex_of_point.size(); i > 0; --i) {
        first_of_vertex_[mesh.vertex_of_point[i - 1]] = correspondence_of_pixel_[i - 1];
    }
    cut_edges(correspondences, parameters, context);
    group_vertices(correspondences, parameters);
}

void StaticRegion::cut_edges(std::span<const Correspondence> correspondences, const RegionParameters& parameters,
                             const RegionContext& context) noexcept {
    EdgeTest test;
    test.change_max_m = parameters.edge_change_max_m;
    test.chi2_max = parameters.edge_chi2_max;
    test.floor_m = parameters.edge_sigma_floor_m;
    test.lag_angle_rad = context.rotation_speed_rad_s * context.colour_depth_lag_s;
    test.camera_from_world_rotation = context.world_from_camera_predicted.rotation.transpose();
    const Mesh& mesh = delaunay_.mesh();
    kept_count_ = 0;
    for (std::size_t i = 0; i < mesh.edges.size(); ++i) {
        const Correspondence& a = correspondences[first_of_vertex_[mesh.edges[i].a]];
        const Correspondence& b = correspondences[first_of_vertex_[mesh.edges[i].b]];
        edge_kept_[i] = keeps_distance(a, b, test) ? 1 : 0;
        kept_count_ += edge_kept_[i];
    }
}

std::uint16_t StaticRegion::root_of(std::uint16_t triangle) noexcept {
    while (parent_[triangle] != triangle) {
        parent_[triangle] = parent_[parent_[triangle]];
        triangle = parent_[triangle];
    }
    return triangle;
}

void StaticRegion::group_vertices(std::span<const Correspondence> correspondences,
                                  const RegionParameters& parameters) noexcept {
    const Mesh& mesh = delaunay_.mesh();
    const std::size_t vertices = mesh.vertices.size();
    const std::size_t triangles = mesh.triangles.size();
    // One lucky edge must not join two bodies: only whole triangles connect (method.md 5), through the edges they
    // share, and none across a step in depth, where one body ends and another begins, whether they have moved against
    // each other yet or not.
    const auto is_whole = [&](const MeshTriangle& t) {
        for (int k = 0; k < 3; ++k) {
            if (edge_kept_[t.edge[k]] == 0) return false;
            const MeshEdge& edge = mesh.edges[t.edge[k]];
            if (is_depth_step(correspondences[first_of_vertex_[edge.a]], correspondences[first_of_vertex_[edge.b]],
                              parameters)) {
                return false;
            }
        }
        return true;
    };
    area_all_px2_ = 0;
    for (std::size_t i = 0; i < triangles; ++i) {
        area_all_px2_ += twice_area(mesh, mesh.triangles[i]) * kArea_px2;
        parent_[i] = is_whole(mesh.triangles[i]) ? static_cast<std::uint16_t>(i) : kNoGroup;
        triangles_of_[i] = 0;
    }
    for (const MeshEdge& edge : mesh.edges) {
        if (edge.left_triangle == kNoTriangle || edge.right_triangle == kNoTriangle) continue;
        if (parent_[edge.left_triangle] == kNoGroup || parent_[edge.right_triangle] == kNoGroup) continue;
        const std::uint16_t left = root_of(static_cast<std::uint16_t>(edge.left_triangle));
        const std::uint16_t right = root_of(static_cast<std::uint16_t>(edge.right_triangle));
        parent_[std::max(left, right)] = std::min(left, right);
    }
    roots_.clear();  // of the groups, largest first, ties by the lower root
    for (std::size_t i = 0; i < triangles; ++i) {
        if (parent_[i] == kNoGroup) continue;
        const std::uint16_t root = root_of(static_cast<std::uint16_t>(i));
        if (triangles_of_[root]++ == 0) STILLMESH_CHECK(roots_.push(root));
    }
    sort(roots_.span(), [&](std::uint16_t a, std::uint16_t b) {
        return triangles_of_[a] != triangles_of_[b] ? triangles_of_[a] > triangles_of_[b] : a < b;
    });
    groups_count_ = static_cast<std::uint32_t>(std::min(roots_.size(), groups_.size()));
    for (const std::uint16_t root : roots_) triangles_of_[root] = kNoGroup;  // from here on: the root's group
    for (std::uint32_t g = 0; g < groups_count_; ++g) {
        groups_[g] = Group{};
        triangles_of_[roots_[g]] = static_cast<std::uint16_t>(g);
    }
    // A vertex that several groups share belongs to the largest.
    members_.set_size(vertices);
    for (std::size_t i = 0; i < vertices; ++i) members_[i] = kNoGroup;
    for (std::size_t i = 0; i < triangles; ++i) {
        if (parent_[i] == kNoGroup) continue;
        const std::uint16_t g = triangles_of_[root_of(static_cast<std::uint16_t>(i))];
        if (g == kNoGroup) continue;
        groups_[g].area_px2 += twice_area(mesh, mesh.triangles[i]) * kArea_px2;
        for (const std::uint32_t vertex : mesh.triangles[i].vertex) members_[vertex] = std::min(members_[vertex], g);
    }
    for (std::size_t i = 0; i < mesh.vertex_of_point.size(); ++i) {
        const std::uint16_t g = members_[mesh.vertex_of_point[i]];
        group_of_correspondence_[correspondence_of_pixel_[i]] = g;
        if (g != kNoGroup) ++groups_[g].points;
    }
    const auto points_all = static_cast<double>(mesh.vertex_of_point.size());
    for (std::uint32_t g = 0; g < groups_count_; ++g) {  // Eq. 1
        groups_[g].score = parameters.score_points * groups_[g].points / points_all;
        if (area_all_px2_ > 0) groups_[g].score += parameters.score_area * groups_[g].area_px2 / area_all_px2_;
    }
}

StaticRegion::Support StaticRegion::support_of(std::span<const Correspondence> correspondences,
                                               const SE3& world_from_camera, const Configuration& parameters,
                                               const RegionContext& context) noexcept {
    Support support;
    const SE3 camera_from_world = world_from_camera.inverse();
    const RegionParameters& region = parameters.region;
    const double chi2_max = region.point_chi2_max;
    for (std::uint32_t g = 0; g < fitted_groups_; ++g) groups_[g].badness_sum = 0;
    for (std::size_t i = 0; i < correspondences.size(); ++i) {
        const double bad = badness(correspondences[i], camera_from_world, region);
        is_inlier_[i] = bad <= chi2_max ? 1 : 0;
        const std::uint16_t g = group_of_correspondence_[i];
        if (g < fitted_groups_ && correspondences[i].vote > 0)
            groups_[g].badness_sum += std::min(bad, region.badness_max);
    }
    // A body agrees with a motion that explains it about as well as its own best motion does: many small residuals that
    // each pass say "moves" together long before one of them does. What fitting six unknowns gains does not grow with
    // the points, so a large body may bear less for each of them than a small one.
    for (std::uint32_t g = 0; g < fitted_groups_; ++g) groups_[g].agreement = agreement(groups_[g], region);
    double votes = 0;
    double votes_all = 0;
    for (std::size_t i = 0; i < correspondences.size(); ++i) {
        const Correspondence& c = correspondences[i];
        votes_all += area_of(c);
        if (is_inlier_[i] == 0) continue;
        votes += area_of(c) * agreement_at(i);
        ++support.inliers;
    }
    // Eq. 1 with votes: a point counts by what the past knows of it, a triangle when all of it agrees.
    const Mesh& mesh = delaunay_.mesh();
    double area = 0;
    double area_all = 0;
    for (const MeshTriangle& triangle : mesh.triangles) {
        const std::uint16_t a = first_of_vertex_[triangle.vertex[0]];
        const std::uint16_t b = first_of_vertex_[triangle.vertex[1]];
        const std::uint16_t c = first_of_vertex_[triangle.vertex[2]];
        const double vote = (correspondences[a].vote + correspondences[b].vote + correspondences[c].vote) / 3.0;
        // In square metres: what moves is close and small, what stands still is the room around it. (The paper counts
        // pixels, and a person at arm's length has more of them than the wall behind.)
        const double z =
            (correspondences[a].p_camera.z() + correspondences[b].p_camera.z() + correspondences[c].p_camera.z()) / 3.0;
        const double weighted = vote * twice_area(mesh, triangle) * z * z;
        area_all += weighted;
        if (is_inlier_[a] != 0 && is_inlier_[b] != 0 && is_inlier_[c] != 0) {
            area += weighted * std::min({agreement_at(a), agreement_at(b), agreement_at(c)});
        }
    }
    double weight_sum = region.score_points;
    double score = votes_all > 0 ? region.score_points * votes / votes_all : 0.0;
    if (area_all > 0) {
        score += region.score_area * area / area_all;
        weight_sum += region.score_area;
    }
    if (context.has_prediction) {
        const SE3 off = context.world_from_camera_predicted.inverse() * world_from_camera;
        const double angle = rotation_angle(off.rotation) / context.prediction_sigma_rad;
        const double d2 =
            off.translation.squaredNorm() / (context.prediction_sigma_m * context.prediction_sigma_m) + angle * angle;
        score += region.prior_weight / (1.0 + d2 / (region.prior_sigmas * region.prior_sigmas));
        weight_sum += region.prior_weight;
        // No camera on a robot or in a hand jumps: a motion far off the prediction needs far more support.
        support.plausibility = 1.0 / (1.0 + d2 / (region.plausible_sigmas * region.plausible_sigmas));
        score *= support.plausibility;
    }
    support.score = weight_sum > 0 ? score / weight_sum : 0.0;
    return support;
}

double StaticRegion::agreement(const Group& group, const RegionParameters& region) noexcept {
    if (group.voters == 0) return 1.0;
    const double excess = group.badness_sum - group.voters * group.badness_best;
    const double bearable = region.agreement_base + region.agreement_share * group.voters;
    return std::clamp(1.0 - excess / (bearable * (group.badness_best + region.agreement_floor)), 0.0, 1.0);
}

// Every group's own best motion, by descending size, as far as the iterations go.
void StaticRegion::fit_groups(std::span<const Correspondence> correspondences, const Configuration& parameters,
                              RegionChoice& choice, Random& random) noexcept {
    RansacOptions options = ransac_options(parameters, parameters.pose.coarse_factor);
    options.inlier_ratio_start = parameters.region.group_inliers_start;
    fitted_groups_ = 0;
    for (std::uint32_t g = 0; g < groups_count_ && g < kFittedGroupsMax; ++g) {
        Group& group = groups_[g];
        if (choice.iterations >= parameters.pose.coarse_total_max) break;
        fitted_groups_ = g + 1;
        group.voters = 0;
        group.is_fitted = false;
        members_.clear();
        for (const std::uint16_t i : all_) {
            if (group_of_correspondence_[i] == g) STILLMESH_CHECK(members_.push(i));
        }
        if (members_.size() < parameters.region.group_points_min) continue;
        options.iterations_max =
            std::min(parameters.pose.coarse_iterations_max, parameters.pose.coarse_total_max - choice.iterations);
        const RansacResult result = ransac_pose(correspondences, members_.span(), nullptr, options, random);
        choice.iterations += result.iterations;
        if (!result.is_valid) continue;
        const PoseFit fit = optimise_pose(correspondences, members_.span(), result.world_from_camera,
                                          parameters.region.point_chi2_max, parameters.pose.coarse_passes_max);
        group.motion = fit.is_valid ? fit.world_from_camera : result.world_from_camera;
        group.is_fitted = true;
        const SE3 camera_from_world = group.motion.inverse();
        double sum = 0;
        for (const std::uint16_t i : members_) {
            sum += std::min(badness(correspondences[i], camera_from_world, parameters.region),
                            parameters.region.badness_max);
        }
        group.voters = static_cast<std::uint32_t>(members_.size());
        group.badness_best = sum / group.voters;
    }
}

void StaticRegion::gather_inliers(std::span<const Correspondence> correspondences, const SE3& world_from_camera,
                                  double chi2_max, double chi2_anchor_max,
                                  FixedVector<std::uint16_t>& out) const noexcept {
    out.clear();
    const SE3 camera_from_world = world_from_camera.inverse();
    for (std::size_t i = 0; i < correspondences.size(); ++i) {
        const Correspondence& c = correspondences[i];
        if (!(c.vote > 0)) continue;
        if (chi2_of(c, camera_from_world) <= chi2_max && chi2_of_anchor(c, camera_from_world) <= chi2_anchor_max) {
            STILLMESH_CHECK(out.push(static_cast<std::uint16_t>(i)));
        }
    }
}

RegionChoice StaticRegion::choose(std::span<const Correspondence> correspondences, const Configuration& parameters,
                                  const RegionContext& context, Random& random) noexcept {
    struct Hypothesis {
        SE3 pose;
        double score = 0;
        double plausibility = 1;
        std::uint32_t inliers = 0;
    };
    constexpr std::size_t kHypothesesMax = 14;
    InlineVector<Hypothesis, kHypothesesMax> hypotheses;
    RegionChoice choice;
    chosen_.clear();
    all_.clear();
    for (std::size_t i = 0; i < correspondences.size(); ++i) {
        explained_by_[i] = 0;
        if (correspondences[i].vote > 0) STILLMESH_CHECK(all_.push(static_cast<std::uint16_t>(i)));
    }
    const RegionParameters& region = parameters.region;
    const double chi2_max = region.point_chi2_max;
    const auto propose = [&](const SE3& pose, double reach) {
        // Refined on what agrees with it, so that hypotheses are compared at their best.
        gather_inliers(correspondences, pose, reach * chi2_max, region.anchor_inlier_factor * (reach * chi2_max),
                       inliers_);
        const PoseFit fit =
            optimise_pose(correspondences, inliers_.span(), pose, chi2_max, parameters.pose.coarse_passes_max);
        Hypothesis h;
        h.pose = fit.is_valid ? fit.world_from_camera : pose;
        const Support support = support_of(correspondences, h.pose, parameters, context);
        const std::size_t bit = hypotheses.size();
        for (std::size_t i = 0; i < correspondences.size(); ++i) {
            if (is_inlier_[i] != 0) explained_by_[i] = static_cast<std::uint16_t>(explained_by_[i] | 1U << bit);
        }
        h.score = support.score;
        h.plausibility = support.plausibility;
        h.inliers = support.inliers;
        static_cast<void>(hypotheses.push(h));
    };
    RansacOptions options = ransac_options(parameters, parameters.pose.coarse_factor);
    options.iterations_max = parameters.pose.coarse_iterations_max;
    options.inlier_ratio_start = context.inlier_ratio;

    fitted_groups_ = 0;
    if (parameters.region.is_enabled) fit_groups(correspondences, parameters, choice, random);
    if (context.has_prediction) {
        const PoseFit fit = optimise_pose(correspondences, all_.span(), context.world_from_camera_predicted, chi2_max,
                                          parameters.pose.expected_passes_max);
        propose(fit.is_valid ? fit.world_from_camera : context.world_from_camera_predicted, region.reach_factor);
    }
    const RansacResult over_all = ransac_pose(correspondences, all_.span(), nullptr, options, random);
    choice.iterations += over_all.iterations;
    if (over_all.is_valid) propose(over_all.world_from_camera, region.reach_factor);
    if (parameters.region.is_enabled) {
        for (std::uint32_t g = 0; g < fitted_groups_; ++g) {
            if (groups_[g].is_fitted && hypotheses.size() < kHypothesesMax) propose(groups_[g].motion, 1.0);
        }
    }
    // Who agrees with nobody yet may have a motion of his own, however few he is: RANSAC over all finds the most
    // points, and those may be the crowd.
    for (std::uint32_t round = 0; region.is_enabled && round < region.left_over_rounds; ++round) {
        if (hypotheses.size() == kHypothesesMax || choice.iterations >= parameters.pose.coarse_total_max) break;
        members_.clear();
        for (const std::uint16_t i : all_) {
            if (explained_by_[i] == 0) STILLMESH_CHECK(members_.push(i));
        }
        if (members_.size() < region.left_over_min) break;
        options.iterations_max =
            std::min(parameters.pose.coarse_iterations_max, parameters.pose.coarse_total_max - choice.iterations);
        options.inlier_ratio_start = region.left_over_inliers_start;
        const RansacResult result = ransac_pose(correspondences, members_.span(), nullptr, options, random);
        choice.iterations += result.iterations;
        if (!result.is_valid || result.inliers < parameters.region.group_points_min) break;
        propose(result.world_from_camera, region.reach_factor);
    }
    if (hypotheses.size() == 0) return choice;
    std::size_t explained = 0;
    for (const std::uint16_t i : all_) explained += explained_by_[i] != 0 ? 1U : 0U;
    choice.explained_share =
        static_cast<double>(explained) / static_cast<double>(std::max<std::size_t>(all_.size(), 1));
    std::size_t best = 0;
    for (std::size_t i = 1; i < hypotheses.size(); ++i) {
        if (hypotheses[i].score > hypotheses[best].score) best = i;
    }
    // How sure: against every other motion, what only the choice explains, and what only the other one does; by area,
    // as a feature stands for more of the room the farther away it is.
    choice.margin = 1.0;
    double area_all = 0;
    for (const Correspondence& c : correspondences) area_all += area_of(c);
    for (std::size_t i = 0; i < hypotheses.size(); ++i) {
        if (i == best) continue;
        const SE3 off = hypotheses[best].pose.inverse() * hypotheses[i].pose;
        if (off.translation.squaredNorm() < region.same_motion_m * region.same_motion_m &&
            rotation_angle(off.rotation) < region.same_motion_rad) {
            continue;
        }
        double ours = 0;
        double theirs = 0;
        for (std::size_t k = 0; k < correspondences.size(); ++k) {
            const bool is_ours = (explained_by_[k] >> best & 1U) != 0;
            const bool is_theirs = (explained_by_[k] >> i & 1U) != 0;
            if (is_ours && !is_theirs) ours += area_of(correspondences[k]);
            if (!is_ours && is_theirs) theirs += area_of(correspondences[k]);
        }
        theirs *= std::min(hypotheses[i].plausibility / hypotheses[best].plausibility, 1.0);
        if (theirs < region.rival_area_min * area_all) continue;  // noise
        choice.margin = std::min(choice.margin, (ours - theirs) / (ours + theirs));
    }
    choice.world_from_camera = hypotheses[best].pose;
    choice.score = hypotheses[best].score;
    static_cast<void>(support_of(correspondences, choice.world_from_camera, parameters, context));
    gather_inliers(correspondences, choice.world_from_camera, chi2_max, region.anchor_inlier_factor * chi2_max,
                   inliers_);
    for (const std::uint16_t i : inliers_) {
        if (agreement_at(i) > 0) STILLMESH_CHECK(chosen_.push(i));
    }
    choice.is_valid = chosen_.size() >= 3;
    return choice;
}

}  // namespace stillmesh
