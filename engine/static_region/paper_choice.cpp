#include "engine/static_region/paper_choice.hpp"

#include <algorithm>
#include <array>
#include <cmath>
#include <limits>

#include "engine/mesh/predicates.hpp"
#include "engine/pose/ransac.hpp"

namespace stillmesh {
namespace {

constexpr double kPointsWeight = 0.5;        // 2.1.2: W1
constexpr double kAreaWeight = 1.0;          // 2.1.2: W2
constexpr double kSimilarShare = 0.2;        // 3.1: one fifth of the largest error
constexpr double kNear_px = 10.0;            // 3.1: in a typical 640 x 480 frame
constexpr double kNearWidth_px = 640.0;      // 3.1
constexpr std::uint32_t kNewPointsMin = 41;  // 1: more than 40
constexpr std::uint32_t kPosesMax = 32;  // groups with a pose; at r = 0.5 and 3k = 105 iterations the budget holds ten

Vector2 vector_of(PixelPoint p) noexcept {
    return Vector2(p.x, p.y);
}

// From a point to a segment, in squared mesh units.
double squared_distance(PixelPoint p, PixelPoint a, PixelPoint b) noexcept {
    const Vector2 ab = vector_of(b) - vector_of(a);
    const Vector2 ap = vector_of(p) - vector_of(a);
    const double length2 = ab.squaredNorm();
    const double along = length2 > 0 ? std::clamp(ap.dot(ab) / length2, 0.0, 1.0) : 0.0;
    return (ap - along * ab).squaredNorm();
}

// Each segment has the ends of the other one on its two sides.
bool do_cross(PixelPoint a, PixelPoint b, PixelPoint c, PixelPoint d) noexcept {
    return orient2d(a, b, c) * orient2d(a, b, d) < 0 && orient2d(c, d, a) * orient2d(c, d, b) < 0;
}

// The groups of a frame while they are merged: each has the pose of its own RANSAC, or none.
class Clusters {
public:
    Clusters(const RegionInput& input, MeshGroups& groups, FixedVector<std::uint16_t>& scratch, Random& random) noexcept
        : input_(input),
          groups_(groups),
          scratch_(scratch),
          random_(random),
          count_(static_cast<std::uint16_t>(std::min(groups.count(), kPosesMax))) {
        for (std::uint16_t g = 0; g < count_; ++g) fit(g);
    }
    // False: no two groups are eligible.
    [[nodiscard]] bool merge_two() noexcept;
    // Eq. 1; the members of the best are in the scratch.
    [[nodiscard]] RegionChoice choose_best() noexcept;

private:
    struct Cluster {
        SE3 world_from_camera;
        bool has_pose = false;
    };
    void members_of(std::uint16_t group, FixedVector<std::uint16_t>& members) const noexcept;
    void fit(std::uint16_t group) noexcept;
    // Between two poses, m + rad; negative where one is missing.
    [[nodiscard]] double error_between(std::uint16_t a, std::uint16_t b) const noexcept;
    [[nodiscard]] bool is_near(std::uint16_t a, std::uint16_t b) noexcept;

    const RegionInput& input_;
    MeshGroups& groups_;
    FixedVector<std::uint16_t>& scratch_;
    Random& random_;
    std::array<Cluster, kPosesMax> clusters_;
    std::uint16_t count_ = 0;
    std::uint32_t iterations_ = 0;
};

void Clusters::members_of(std::uint16_t group, FixedVector<std::uint16_t>& members) const noexcept {
    members.clear();
    for (const std::uint16_t i : input_.weighted) {
        if (groups_.group_of(i) == group) STILLMESH_CHECK(members.push(i));
    }
}

// 3.1: 3k iterations, k from the inlier ratio of the last frame. What the budget of the frame has no room for keeps the
// pose it has.
void Clusters::fit(std::uint16_t group) noexcept {
    const PoseParameters& pose = input_.configuration.pose;
    members_of(group, input_.scratch);
    if (input_.scratch.size() < input_.configuration.region.group_points_min) return;
    if (iterations_ >= pose.coarse_total_max) return;
    RansacOptions options = ransac_options(input_.configuration, pose.coarse_factor, input_.context.inlier_ratio);
    options.iterations_max = std::min(options.iterations_max, pose.coarse_total_max - iterations_);
    const RansacResult found = ransac_pose(input_.correspondences, input_.scratch.span(), nullptr, options, random_);
    iterations_ += found.iterations;
    if (found.is_valid) clusters_[group] = {found.world_from_camera, true};
}

double Clusters::error_between(std::uint16_t a, std::uint16_t b) const noexcept {
    if (!clusters_[a].has_pose || !clusters_[b].has_pose) return -1;
    const SE3 off = clusters_[a].world_from_camera.inverse() * clusters_[b].world_from_camera;
    return std::sqrt(off.translation.squaredNorm()) + rotation_angle(off.rotation);
}

bool Clusters::is_near(std::uint16_t a, std::uint16_t b) noexcept {
    outline_of(groups_, a, scratch_);
    outline_of(groups_, b, input_.scratch);
    return boundary_distance_px(groups_.mesh(), scratch_.span(), input_.scratch.span()) <
           kNear_px * input_.context.image_width_px / kNearWidth_px;
}

// 2.1.2 and 3.1: of the groups that are close to each other the two with the most similar poses.
bool Clusters::merge_two() noexcept {
    double largest = 0;
    for (std::uint16_t b = 1; b < count_; ++b) {
        for (std::uint16_t a = 0; a < b; ++a) largest = std::max(largest, error_between(a, b));
    }
    double least = kSimilarShare * largest;
    std::uint16_t into = kNoGroup;
    std::uint16_t from = kNoGroup;
    for (std::uint16_t b = 1; b < count_; ++b) {
        for (std::uint16_t a = 0; a < b; ++a) {
            const double error = error_between(a, b);
            if (error < 0 || error >= least || !is_near(a, b)) continue;
            least = error;
            into = a;
            from = b;
        }
    }
    if (into == kNoGroup) return false;
    groups_.merge(into, from);
    clusters_[from].has_pose = false;
    fit(into);
    return true;
}

RegionChoice Clusters::choose_best() noexcept {
    const Mesh& mesh = groups_.mesh();
    double area_all = 0;
    for (const MeshTriangle& t : mesh.triangles)
        area_all += twice_area(mesh.vertices[t.vertex[0]], mesh.vertices[t.vertex[1]], mesh.vertices[t.vertex[2]]);
    RegionChoice choice;
    choice.iterations = iterations_;
    std::uint16_t best = kNoGroup;
    for (std::uint16_t g = 0; g < count_; ++g) {
        if (!clusters_[g].has_pose) continue;
        outline_of(groups_, g, scratch_);
        const double area_share = area_all > 0 ? twice_area(mesh, scratch_.span()) / area_all : 0.0;
        members_of(g, scratch_);
        const double points_share =
            static_cast<double>(scratch_.size()) / static_cast<double>(mesh.vertex_of_point.size());
        const double score = (kPointsWeight * points_share + kAreaWeight * area_share) / (kPointsWeight + kAreaWeight);
        if (best != kNoGroup && score <= choice.score) continue;
        best = g;
        choice.score = score;
        choice.world_from_camera = clusters_[g].world_from_camera;
    }
    choice.margin = 1;
    choice.explained_share = 1;
    choice.is_valid = best != kNoGroup;
    scratch_.clear();
    if (choice.is_valid) members_of(best, scratch_);
    return choice;
}

}  // namespace

Parameters as_in_paper(const Parameters& parameters) noexcept {
    Parameters out = parameters;
    // 2.1.3: the noise is that of the model, and nothing learns another one.
    out.noise.pixel_start = out.noise.pixel_min = 1;
    out.noise.depth_start = out.noise.depth_min = 1;
    out.noise.max = 1;
    out.noise.young_frames = 0;
    // 2.1.1: tau alone decides: an edge that may be off by a metre passes the other test with any change below 2.5 m.
    out.region.edge_sigma_floor_m = 1;
    // 2.1.2: the best group is taken, whatever its score.
    out.region.score_min = 0;
    // 2.2: a weight is for the words alone, and no point loses its say in the pose by it (200 steps below the threshold
    // is out of reach). A place that is seen to be empty does not remove its point.
    out.weights.suspicious = out.weights.eligible;
    out.weights.suspect_steps = 200;
    out.emptiness.places_per_frame = 0;
    // 1: in whatever frame, however few are tracked; no new point counts as one tracked.
    out.keyframes.new_points_min = kNewPointsMin;
    out.keyframes.gap_min = 1;
    out.keyframes.tracked_urgent_permille = 0;
    out.keyframes.new_per_tracked = 10000;
    return out;
}

// Around the hull from its first corner: nothing lies to the right of the way to the next one.
void outline_of(const MeshGroups& groups, std::uint16_t group, FixedVector<std::uint16_t>& outline) noexcept {
    const std::span<const PixelPoint> vertices = groups.mesh().vertices;
    std::size_t first = vertices.size();
    for (std::size_t i = 0; i < vertices.size(); ++i) {
        if (groups.group_of_vertex(i) != group) continue;
        if (first == vertices.size() || is_before(vertices[i], vertices[first])) first = i;
    }
    outline.clear();
    for (std::size_t corner = first; corner < vertices.size() && (outline.is_empty() || corner != first);) {
        STILLMESH_CHECK(outline.push(static_cast<std::uint16_t>(corner)));
        const PixelPoint here = vertices[corner];
        for (std::size_t i = 0; i < vertices.size(); ++i) {
            if (groups.group_of_vertex(i) != group) continue;
            const int turn = orient2d(here, vertices[corner], vertices[i]);
            const double farther = (vector_of(vertices[i]) - vector_of(here)).squaredNorm() -
                                   (vector_of(vertices[corner]) - vector_of(here)).squaredNorm();
            if (turn < 0 || (turn == 0 && farther > 0)) corner = i;
        }
    }
}

double twice_area(const Mesh& mesh, std::span<const std::uint16_t> outline) noexcept {
    double twice = 0;
    for (std::size_t i = 2; i < outline.size(); ++i)
        twice += twice_area(mesh.vertices[outline[0]], mesh.vertices[outline[i - 1]], mesh.vertices[outline[i]]);
    return twice;
}

double boundary_distance_px(const Mesh& mesh, std::span<const std::uint16_t> outline,
                            std::span<const std::uint16_t> other) noexcept {
    double least2 = std::numeric_limits<double>::infinity();
    for (std::size_t i = 0; i < outline.size(); ++i) {
        const PixelPoint a = mesh.vertices[outline[i]];
        const PixelPoint b = mesh.vertices[outline[(i + 1) % outline.size()]];
        for (std::size_t k = 0; k < other.size(); ++k) {
            const PixelPoint c = mesh.vertices[other[k]];
            const PixelPoint d = mesh.vertices[other[(k + 1) % other.size()]];
            if (do_cross(a, b, c, d)) return 0;
            least2 = std::min({least2, squared_distance(a, c, d), squared_distance(c, a, b)});
        }
    }
    return std::sqrt(least2) / kMeshUnitsPerPixel;
}

RegionChoice choose_as_in_paper(const RegionInput& input, MeshGroups& groups, FixedVector<std::uint16_t>& chosen,
                                Random& random) noexcept {
    Clusters clusters(input, groups, chosen, random);
    while (clusters.merge_two()) {
    }
    return clusters.choose_best();
}

}  // namespace stillmesh
