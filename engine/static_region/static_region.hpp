// The paper's heart (2.1, Algorithm 1, Eq. 1; method.md 3 to 5 and 11): a Delaunay mesh over the matched features,
// edges whose 3D length changed are cut, what stays connected through whole triangles is a group, each group proposes a
// pose, and the proposal that explains the most of what the past knows to stand still, spread over the most of the
// image, names the static region. Limits: features_max matches, groups_max groups, the iteration caps of the
// configuration.
#pragma once

#include <cstdint>
#include <span>

#include "engine/base/fixed_vector.hpp"
#include "engine/base/random.hpp"
#include "engine/configuration.hpp"
#include "engine/features/features.hpp"
#include "engine/limits.hpp"
#include "engine/matching/correspondence.hpp"
#include "engine/mesh/delaunay.hpp"

namespace stillmesh {

inline constexpr std::uint16_t kNoGroup = 0xffffU;

struct Group {
    std::uint32_t points = 0;
    double area_px2 = 0;      // of its whole triangles
    double score = 0;         // Eq. 1
    SE3 motion;               // world from camera, if this group stood still; valid iff is_fitted
    double badness_best = 0;  // mean under that motion
    double badness_sum = 0;   // under the motion looked at
    double agreement = 1;     // with the motion looked at, [0, 1]
    std::uint32_t voters = 0;
    bool is_fitted = false;
};

// What is known before this frame is looked at.
struct RegionContext {
    SE3 world_from_camera_predicted;
    double prediction_sigma_m = 0.05;
    double prediction_sigma_rad = 0.05;
    double rotation_speed_rad_s = 0;
    double colour_depth_lag_s = 0;
    double inlier_ratio = 0.5;  // of the last frame
    double way_m = 0;           // the odometer's
    bool has_prediction = false;
};

struct RegionChoice {
    SE3 world_from_camera;         // of the chosen hypothesis
    double score = 0;              // of the choice, [0, 1]
    double margin = 0;             // over the strongest rival, of what only one of both explains; [-1, 1]
    double explained_share = 0;    // of the voters, by any hypothesis
    std::uint32_t iterations = 0;  // of RANSAC
    bool is_valid = false;
};

class StaticRegion {
public:
    static constexpr void plan(ArenaPlan& arena, const Limits& limits) noexcept {
        const std::uint32_t n = limits.features_max;
        Delaunay::plan(arena, n);
        FixedVector<PixelPoint>::plan(arena, n);
        FixedVector<std::uint16_t>::plan(arena, n);
        FixedVector<std::uint16_t>::plan(arena, n);
        FixedVector<std::uint16_t>::plan(arena, n);
        FixedVector<std::uint16_t>::plan(arena, n);
        FixedVector<std::uint16_t>::plan(arena, n);
        FixedVector<std::uint16_t>::plan(arena, mesh_triangles_max(n));
        arena.array<std::uint16_t>(n);
        arena.array<std::uint16_t>(mesh_triangles_max(n));
        arena.array<std::uint16_t>(mesh_triangles_max(n));
        arena.array<std::uint16_t>(n);
        arena.array<std::uint8_t>(mesh_edges_max(n));
        arena.array<std::uint8_t>(n);
        arena.array<std::uint16_t>(n);
        arena.array<Group>(limits.groups_max);
    }
    void create(Arena& arena, const Limits& limits) noexcept;

    // Mesh over the correspondences that have depth; `keypoints` gives their pixels. Edges, groups and their scores.
    void build(std::span<const Correspondence> correspondences, std::span<const Keypoint> keypoints,
               const RegionParameters& parameters, const RegionContext& context) noexcept;
    // Chooses the static region among the hypotheses of the groups, the prediction and the past.
    [[nodiscard]] RegionChoice choose(std::span<const Correspondence> correspondences, const Configuration& parameters,
                                      const RegionContext& context, Random& random) noexcept;

    [[nodiscard]] const Mesh& mesh() const noexcept { return delaunay_.mesh(); }
    // By index of mesh().edges.
    [[nodiscard]] bool is_kept(std::size_t edge) const noexcept { return edge_kept_[edge] != 0; }
    [[nodiscard]] std::uint32_t kept_count() const noexcept { return kept_count_; }
    // Group of a correspondence, kNoGroup for one alone; groups are numbered by descending size.
    [[nodiscard]] std::uint16_t group_of(std::size_t correspondence) const noexcept {
        return group_of_correspondence_[correspondence];
    }
    [[nodiscard]] std::uint32_t groups_count() const noexcept { return groups_count_; }
    [[nodiscard]] const Group& group(std::size_t i) const noexcept { return groups_[i]; }
    // Of a group with the choice, [0, 1]; 1 where there is no group, or none that could be asked.
    [[nodiscard]] double agreement_of(std::uint16_t group) const noexcept {
        return group < fitted_groups_ ? groups_[group].agreement : 1.0;
    }
    // Those that vote, and for each the best motion of its own group; null when it has none.
    [[nodiscard]] std::span<const std::uint16_t> voters() const noexcept { return all_.span(); }
    [[nodiscard]] const SE3* own_motion(std::size_t correspondence) const noexcept {
        const std::uint16_t g = group_of_correspondence_[correspondence];
        return g < fitted_groups_ && groups_[g].is_fitted ? &groups_[g].motion : nullptr;
    }
    // The correspondences that agree with the choice.
    [[nodiscard]] std::span<const std::uint16_t> chosen() const noexcept { return chosen_.span(); }

private:
    struct Support {
        double score = 0;
        double plausibility = 1;  // of the motion, beside the expected one
        std::uint32_t inliers = 0;
    };
    [[nodiscard]] Support support_of(std::span<const Correspondence> correspondences, const SE3& world_from_camera,
                                     const Configuration& parameters, const RegionContext& context) noexcept;
    void gather_inliers(std::span<const Correspondence> correspondences, const SE3& world_from_camera, double chi2_max,
                        double chi2_anchor_max, FixedVector<std::uint16_t>& out) const noexcept;
    void cut_edges(std::span<const Correspondence> correspondences, const RegionParameters& parameters,
                   const RegionContext& context) noexcept;
    void group_vertices(std::span<const Correspondence> correspondences, const RegionParameters& parameters) noexcept;
    void fit_groups(std::span<const Correspondence> correspondences, const Configuration& parameters,
                    RegionChoice& choice, Random& random) noexcept;
    [[nodiscard]] static double agreement(const Group& group, const RegionParameters& region) noexcept;
    [[nodiscard]] double agreement_at(std::size_t correspondence) const noexcept {
        return agreement_of(group_of_correspondence_[correspondence]);
    }
    [[nodiscard]] std::uint16_t root_of(std::uint16_t triangle) noexcept;

    Delaunay delaunay_;
    FixedVector<PixelPoint> pixels_;                      // of the correspondences with depth
    FixedVector<std::uint16_t> correspondence_of_pixel_;  // index into the correspondences
    FixedVector<std::uint16_t> members_;                  // scratch: correspondences of one group
    FixedVector<std::uint16_t> chosen_;
    FixedVector<std::uint16_t> all_;
    FixedVector<std::uint16_t> inliers_;        // scratch
    std::span<std::uint16_t> first_of_vertex_;  // correspondence that stands for a vertex
    std::span<std::uint16_t> parent_;           // union-find over triangles; kNoGroup: not whole
    std::span<std::uint16_t> triangles_of_;     // scratch, by root: how many triangles, then which group
    FixedVector<std::uint16_t> roots_;          // scratch
    std::span<std::uint16_t> group_of_correspondence_;
    std::span<std::uint8_t> edge_kept_;
    std::span<std::uint8_t> is_inlier_;      // scratch, by correspondence
    std::span<std::uint16_t> explained_by_;  // scratch, by correspondence: a bit for each hypothesis it agrees with
    std::span<Group> groups_;
    static constexpr std::uint32_t kFittedGroupsMax = 10;
    std::uint32_t groups_count_ = 0;
    std::uint32_t fitted_groups_ = 0;  // that voted in choose(), the largest
    std::uint32_t kept_count_ = 0;
    double area_all_px2_ = 0;
};

}  // namespace stillmesh
