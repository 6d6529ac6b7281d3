#include "engine/static_region/mesh_groups.hpp"

#include <algorithm>

#include "engine/base/numbers.hpp"
#include "engine/static_region/distance_consistency.hpp"

namespace stillmesh {
namespace {

// Steeper than any surface that shows features on both ends for long.
bool is_depth_step(const Correspondence& a, const Correspondence& b, const RegionParameters& region) noexcept {
    const double step = a.p_camera.z() - b.p_camera.z();
    const double across = (a.normalised - b.normalised).squaredNorm() * a.p_camera.z() * b.p_camera.z();
    return step * step > region.step_m * region.step_m && step * step > region.step_slope * region.step_slope * across;
}

}  // namespace

void MeshGroups::create(Arena& arena, const Limits& limits) noexcept {
    const std::uint32_t n = limits.features_max;
    groups_max_ = limits.groups_max;
    delaunay_.create(arena, n);
    pixels_.create(arena, n);
    correspondence_of_pixel_.create(arena, n);
    first_of_vertex_ = arena.array<std::uint16_t>(n);
    group_of_correspondence_ = arena.array<std::uint16_t>(n);
    edge_kept_ = arena.array<std::uint8_t>(mesh_edges_max(n));
    components_.create(arena, mesh_triangles_max(n));
}

void MeshGroups::build(std::span<const Correspondence> correspondences, std::span<const Keypoint> keypoints,
                       const RegionParameters& parameters, const RegionContext& context) noexcept {
    triangulate(correspondences, keypoints);
    cut_edges(correspondences, parameters, context);
    if (parameters.is_paper()) {
        connect_edges();
    } else {
        connect_triangles(correspondences, parameters);
    }
    group_correspondences();
}

void MeshGroups::triangulate(std::span<const Correspondence> correspondences,
                             std::span<const Keypoint> keypoints) noexcept {
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
    for (std::size_t i = mesh().vertex_of_point.size(); i > 0; --i)
        first_of_vertex_[mesh().vertex_of_point[i - 1]] = correspondence_of_pixel_[i - 1];
}

void MeshGroups::cut_edges(std::span<const Correspondence> correspondences, const RegionParameters& parameters,
                           const RegionContext& context) noexcept {
    EdgeTest test;
    test.change_max_m = parameters.edge_change_max_m;
    test.chi2_max = parameters.edge_chi2_max;
    test.floor_m = parameters.edge_sigma_floor_m;
    test.lag_angle_rad = context.rotation_speed_rad_s * context.colour_depth_lag_s;
    test.camera_from_world_rotation = context.world_from_camera_predicted.rotation.transpose();
    kept_count_ = 0;
    for (std::size_t i = 0; i < mesh().edges.size(); ++i) {
        const Correspondence& a = correspondences[first_of_vertex_[mesh().edges[i].a]];
        const Correspondence& b = correspondences[first_of_vertex_[mesh().edges[i].b]];
        edge_kept_[i] = keeps_distance(a, b, test) ? 1 : 0;
        kept_count_ += edge_kept_[i];
    }
}

// All its edges are kept, and none crosses a step in depth, where one body ends and another begins, whether they have
// moved against each other yet or not.
bool MeshGroups::is_whole(const MeshTriangle& triangle, std::span<const Correspondence> correspondences,
                          const RegionParameters& parameters) const noexcept {
    for (const std::uint32_t i : triangle.edge) {
        if (!is_kept(i)) return false;
        const MeshEdge& edge = mesh().edges[i];
        if (is_depth_step(correspondences[first_of_vertex_[edge.a]], correspondences[first_of_vertex_[edge.b]],
                          parameters)) {
            return false;
        }
    }
    return true;
}

// One lucky edge must not join two bodies: only whole triangles connect, through the edges they share (method.md 5).
void MeshGroups::connect_triangles(std::span<const Correspondence> correspondences,
                                   const RegionParameters& parameters) noexcept {
    const std::span<const MeshTriangle> triangles = mesh().triangles;
    components_.begin(triangles.size());
    for (std::size_t i = 0; i < triangles.size(); ++i) {
        if (is_whole(triangles[i], correspondences, parameters)) components_.add(i);
    }
    for (const MeshEdge& edge : mesh().edges) {
        if (edge.left_triangle == kNoTriangle || edge.right_triangle == kNoTriangle) continue;
        if (components_.has(edge.left_triangle) && components_.has(edge.right_triangle))
            components_.join(edge.left_triangle, edge.right_triangle);
    }
    count_ = components_.number(groups_max_);
    for (std::size_t i = 0; i < triangles.size(); ++i) {
        const std::uint16_t group = components_.of(i);
        // A vertex that several groups share belongs to the largest.
        for (const std::uint32_t vertex : triangles[i].vertex) {
            std::uint16_t& group_now = group_of_correspondence_[first_of_vertex_[vertex]];
            group_now = std::min(group_now, group);
        }
    }
}

// The paper (2.1.2): what the kept edges connect is a group; a vertex that lost all its edges is in none.
void MeshGroups::connect_edges() noexcept {
    components_.begin(mesh().vertices.size());
    for (std::size_t i = 0; i < mesh().edges.size(); ++i) {
        if (!is_kept(i)) continue;
        const MeshEdge& edge = mesh().edges[i];
        for (const std::uint32_t vertex : {edge.a, edge.b}) {
            if (!components_.has(vertex)) components_.add(vertex);
        }
        components_.join(edge.a, edge.b);
    }
    count_ = components_.number(groups_max_);
    for (std::size_t i = 0; i < mesh().vertices.size(); ++i)
        group_of_correspondence_[first_of_vertex_[i]] = components_.of(i);
}

void MeshGroups::merge(std::uint16_t into, std::uint16_t from) noexcept {
    for (const std::uint16_t i : correspondence_of_pixel_) {
        if (group_of_correspondence_[i] == from) group_of_correspondence_[i] = into;
    }
}

// The other correspondences in a vertex's cell.
void MeshGroups::group_correspondences() noexcept {
    for (std::size_t i = 0; i < mesh().vertex_of_point.size(); ++i)
        group_of_correspondence_[correspondence_of_pixel_[i]] = group_of_vertex(mesh().vertex_of_point[i]);
}

}  // namespace stillmesh
