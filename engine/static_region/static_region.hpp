// The paper's heart (2.1, Algorithm 1, Eq. 1; method.md 3 to 5 and 11): a Delaunay mesh over the matched features,
// edges whose 3D length changed are cut, what stays connected through whole triangles is a group, each group proposes a
// pose, and the proposal that explains the most of what the past knows to stand still, spread over the most of the
// image, names the static region. Here is what a frame asks for; the steps are mesh_groups, group_motions, hypotheses
// and choice; paper_choice is the paper to the letter (region.method). Limits: features_max matches, groups_max groups,
// the iteration caps of the configuration.
#pragma once

#include <cstdint>
#include <span>

#include "engine/base/fixed_vector.hpp"
#include "engine/base/random.hpp"
#include "engine/features/features.hpp"
#include "engine/limits.hpp"
#include "engine/matching/correspondence.hpp"
#include "engine/parameters.hpp"
#include "engine/static_region/choice.hpp"
#include "engine/static_region/hypotheses.hpp"
#include "engine/static_region/mesh_groups.hpp"
#include "engine/static_region/region_context.hpp"

namespace stillmesh {

class StaticRegion {
public:
    static constexpr void plan(ArenaPlan& arena, const Limits& limits) noexcept {
        MeshGroups::plan(arena, limits);
        Hypotheses::plan(arena, limits);
        FixedVector<std::uint16_t>::plan(arena, limits.features_max);
        FixedVector<std::uint16_t>::plan(arena, limits.features_max);
        FixedVector<std::uint16_t>::plan(arena, limits.features_max);
    }
    void create(Arena& arena, const Limits& limits) noexcept;

    // The mesh over the correspondences that have depth, and its groups; `keypoints` gives their pixels.
    void build(std::span<const Correspondence> correspondences, std::span<const Keypoint> keypoints,
               const RegionParameters& parameters, const RegionContext& context) noexcept;
    // Chooses the static region among the hypotheses of the groups, the prediction and the past.
    [[nodiscard]] RegionChoice choose(std::span<const Correspondence> correspondences, const Parameters& parameters,
                                      const RegionContext& context, Random& random) noexcept;

    [[nodiscard]] const Mesh& mesh() const noexcept { return groups_.mesh(); }
    // By index of mesh().edges.
    [[nodiscard]] bool is_kept(std::size_t edge) const noexcept { return groups_.is_kept(edge); }
    [[nodiscard]] std::uint32_t kept_count() const noexcept { return groups_.kept_count(); }
    // Group of a correspondence, kNoGroup for one alone; groups are numbered by descending size.
    [[nodiscard]] std::uint16_t group_of(std::size_t correspondence) const noexcept {
        return groups_.group_of(correspondence);
    }
    [[nodiscard]] std::uint32_t groups_count() const noexcept { return groups_.count(); }
    // Of a group with the choice, [0, 1]; 1 where there is no group, or none with a motion of its own. In the paper the
    // chosen group alone has a say: 0 for all others.
    [[nodiscard]] double agreement_of(std::uint16_t group) const noexcept {
        if (only_group_ != kNoGroup) return group == only_group_ ? 1.0 : 0.0;
        return hypotheses_.motions().agreement_of(group);
    }
    // Those with a weight, and for each the best motion of its own group; null when it has none.
    [[nodiscard]] std::span<const std::uint16_t> weighted() const noexcept { return weighted_.span(); }
    [[nodiscard]] const SE3* own_motion(std::size_t correspondence) const noexcept {
        return hypotheses_.motions().motion_of(groups_.group_of(correspondence));
    }
    // Which of both motions explains a correspondence: TrackingView::kByChoice, kByRival.
    [[nodiscard]] std::uint8_t explained_by(const RegionChoice& choice, std::size_t correspondence) const noexcept;
    // The correspondences that agree with the choice.
    [[nodiscard]] std::span<const std::uint16_t> chosen() const noexcept { return chosen_.span(); }

private:
    MeshGroups groups_;
    Hypotheses hypotheses_;
    FixedVector<std::uint16_t> weighted_;
    FixedVector<std::uint16_t> chosen_;
    FixedVector<std::uint16_t> scratch_;
    std::uint16_t only_group_ = kNoGroup;  // of which the choice consists, as in the paper
};

}  // namespace stillmesh
