// A frame's mesh in groups (paper 2.1.1 and 2.1.2, method.md 3 to 5): a Delaunay mesh over the matched features, whose
// edges are cut where their 3D length changed; what stays connected is a group: through whole triangles, or through
// single edges as in the paper (region.method). Limits: features_max matches, groups_max groups, smaller ones beyond
// stay without a number. Cost: that of the mesh, and one pass over it.
#pragma once

#include <cstdint>
#include <span>

#include "engine/base/fixed_vector.hpp"
#include "engine/features/features.hpp"
#include "engine/limits.hpp"
#include "engine/matching/correspondence.hpp"
#include "engine/mesh/delaunay.hpp"
#include "engine/parameters.hpp"
#include "engine/static_region/components.hpp"
#include "engine/static_region/region_context.hpp"

namespace stillmesh {

inline constexpr std::uint16_t kNoGroup = Components::kNone;

class MeshGroups {
public:
    static constexpr void plan(ArenaPlan& arena, const Limits& limits) noexcept {
        const std::uint32_t n = limits.features_max;
        Delaunay::plan(arena, n);
        FixedVector<PixelPoint>::plan(arena, n);
        FixedVector<std::uint16_t>::plan(arena, n);
        arena.array<std::uint16_t>(n);
        arena.array<std::uint16_t>(n);
        arena.array<std::uint8_t>(mesh_edges_max(n));
        Components::plan(arena, mesh_triangles_max(n));
    }
    void create(Arena& arena, const Limits& limits) noexcept;

    // Over the correspondences that have depth; `keypoints` gives their pixels.
    void build(std::span<const Correspondence> correspondences, std::span<const Keypoint> keypoints,
               const RegionParameters& parameters, const RegionContext& context) noexcept;

    [[nodiscard]] const Mesh& mesh() const noexcept { return delaunay_.mesh(); }
    // By index of mesh().edges.
    [[nodiscard]] bool is_kept(std::size_t edge) const noexcept { return edge_kept_[edge] != 0; }
    [[nodiscard]] std::uint32_t kept_count() const noexcept { return kept_count_; }
    // The first correspondence in a vertex's cell stands for it.
    [[nodiscard]] std::uint16_t correspondence_of(std::size_t vertex) const noexcept {
        return first_of_vertex_[vertex];
    }
    // Group of a correspondence, kNoGroup for one alone; groups are numbered by descending size.
    [[nodiscard]] std::uint16_t group_of(std::size_t correspondence) const noexcept {
        return group_of_correspondence_[correspondence];
    }
    [[nodiscard]] std::uint32_t count() const noexcept { return count_; }
    // By index of mesh().vertices.
    [[nodiscard]] std::uint16_t group_of_vertex(std::size_t vertex) const noexcept {
        return group_of_correspondence_[first_of_vertex_[vertex]];
    }
    // The members of group `from` are those of group `into`; nothing is numbered anew.
    void merge(std::uint16_t into, std::uint16_t from) noexcept;

private:
    void triangulate(std::span<const Correspondence> correspondences, std::span<const Keypoint> keypoints) noexcept;
    void cut_edges(std::span<const Correspondence> correspondences, const RegionParameters& parameters,
                   const RegionContext& context) noexcept;
    void connect_triangles(std::span<const Correspondence> correspondences,
                           const RegionParameters& parameters) noexcept;
    [[nodiscard]] bool is_whole(const MeshTriangle& triangle, std::span<const Correspondence> correspondences,
                                const RegionParameters& parameters) const noexcept;
    void connect_edges() noexcept;
    void group_correspondences() noexcept;

    Delaunay delaunay_;
    FixedVector<PixelPoint> pixels_;                      // of the correspondences with depth
    FixedVector<std::uint16_t> correspondence_of_pixel_;  // index into the correspondences
    std::span<std::uint16_t> first_of_vertex_;            // correspondence that stands for a vertex
    std::span<std::uint16_t> group_of_correspondence_;
    std::span<std::uint8_t> edge_kept_;
    Components components_;  // of the triangles; in the paper of the vertices, which from five on are no more
    std::uint32_t groups_max_ = 0;
    std::uint32_t count_ = 0;
    std::uint32_t kept_count_ = 0;
};

}  // namespace stillmesh
