// Delaunay triangulation by divide and conquer (Guibas & Stolfi 1985; paper 2.1.1, method.md 3) on exact integer
// predicates, in fixed memory, without recursion. The same points give the same mesh on every processor.
// Limits: n points give at most n vertices, 3n - 6 edges, 2n - 5 triangles. Cost O(n log n).
#pragma once

#include <cstdint>
#include <span>

#include "engine/base/arena.hpp"
#include "engine/base/status.hpp"
#include "engine/mesh/pixel_point.hpp"

namespace stillmesh {

// A planar triangulation of n points has at most 3n - 6 edges and 2n - 5 triangles.
[[nodiscard]] constexpr std::uint32_t mesh_edges_max(std::uint32_t n) noexcept {
    return n < 3 ? (n == 2 ? 1 : 0) : 3 * n - 6;
}
[[nodiscard]] constexpr std::uint32_t mesh_triangles_max(std::uint32_t n) noexcept {
    return n < 3 ? 0 : 2 * n - 5;
}

inline constexpr std::uint32_t kNoTriangle = 0xffffffffU;

// An undirected edge between two vertices, a < b, with the triangles on its sides (kNoTriangle on the hull).
struct MeshEdge {
    std::uint32_t a = 0, b = 0;
    std::uint32_t left_triangle = kNoTriangle;   // left of a -> b
    std::uint32_t right_triangle = kNoTriangle;  // right of a -> b
};

// Counter-clockwise in a frame with x right and y up, which on screen (y down) reads clockwise; the smallest
// vertex first.
struct MeshTriangle {
    std::uint32_t vertex[3] = {0, 0, 0};
    std::uint32_t edge[3] = {0, 0, 0};  // edge[k] joins vertex[k] and vertex[(k + 1) % 3]
};

// What a triangulation is, borrowed from the Delaunay that made it until its next triangulate().
struct Mesh {
    std::span<const PixelPoint> vertices;            // distinct points, in order of first appearance in the input
    std::span<const std::uint32_t> vertex_of_point;  // for each input point its vertex (points in one cell share it)
    std::span<const MeshEdge> edges;                 // sorted by (a, b)
    std::span<const MeshTriangle> triangles;         // sorted by vertices
};

class Delaunay {
    // All arrays, for the plan and for the arena. Above plan(): clang evaluates no template that it has not seen.
    template <typename A>
    constexpr void take_arrays(A& arena, std::uint32_t points_max) noexcept {
        const std::size_t n = points_max;
        const std::size_t edges = mesh_edges_max(points_max);
        arena.take(vertices_, n);
        arena.take(vertex_of_point_, n);
        arena.take(edges_, edges);
        arena.take(triangles_, mesh_triangles_max(points_max) + 1);
        arena.take(keys_, n);
        arena.take(keys_other_, n);
        arena.take(order_, n);
        arena.take(strip_begin_, kColumns + 1);
        arena.take(counts_, kDigits);
        arena.take(half_edges_, 2 * edges);
        arena.take(begin_by_b_, n);
        arena.take(begin_by_a_, n);
        arena.take(half_edge_by_b_, edges);
        arena.take(half_edge_of_edge_, edges);
        arena.take(edge_of_slot_, edges);
    }

public:
    static constexpr void plan(ArenaPlan& arena, std::uint32_t points_max) noexcept {
        Delaunay().take_arrays(arena, points_max);
    }
    void create(Arena& arena, std::uint32_t points_max) noexcept;

    // Triangulates the points (coordinates in [0, kMeshCoordinateMax]). Cocircular points: a rule that depends on the
    // points alone decides, see delaunay.cpp.
    //   kOk          mesh() is a full Delaunay triangulation, at least one triangle
    //   kDegenerate  fewer than three distinct points, or all on one line: mesh() holds the vertices and the edges
    //                between neighbours on the line, and no triangle
    //   kFull        more than points_max; mesh() is empty
    //   kInvalid     a coordinate out of range; mesh() is empty
    [[nodiscard]] Status triangulate(std::span<const PixelPoint> points) noexcept;
    [[nodiscard]] const Mesh& mesh() const noexcept { return mesh_; }

private:
    // One direction of an edge; its other direction is the neighbour in the array (index ^ 1). Carries its origin's
    // coordinates, so that the inner loops touch nothing else.
    struct HalfEdge {
        std::uint32_t origin = 0;    // vertex
        std::uint32_t next = 0;      // counter-clockwise around the origin
        std::uint32_t previous = 0;  // clockwise around the origin
        std::int16_t x = 0, y = 0;   // of the origin
    };
    class Subdivision;
    static_assert(kMeshCoordinateMax <= INT16_MAX);

    static constexpr std::uint32_t kDigits = 1024 + 512 + 512;  // the 28 bits of a point in three radix passes
    static constexpr std::uint32_t kColumns = 512;              // of 4 px, which strips are made of
    static constexpr std::uint32_t kLevelsMax = 32;             // of the merge tree over 2^32 points

    void sort_and_number(std::span<const PixelPoint> points) noexcept;
    std::uint32_t cut_into_strips() noexcept;
    void write_out(const Subdivision& subdivision) noexcept;

    std::uint32_t points_max_ = 0;
    std::uint32_t vertices_count_ = 0;
    Mesh mesh_;
    std::span<PixelPoint> vertices_;
    std::span<std::uint32_t> vertex_of_point_;
    std::span<MeshEdge> edges_;
    std::span<MeshTriangle> triangles_;

    std::span<std::uint64_t> keys_, keys_other_;  // (y, x, input index), sorted into one another
    const std::uint64_t* sorted_ = nullptr;       // the one that ended up sorted
    std::span<std::uint32_t> order_;              // vertices, strip by strip, each by (y, x)
    std::span<std::uint32_t> strip_begin_;        // into order_, one more than there are strips
    std::span<std::uint32_t> counts_;             // of digits, then of columns
    std::span<HalfEdge> half_edges_;
    std::span<std::uint32_t> begin_by_b_, begin_by_a_;  // of a vertex's edges, by its being the larger or the smaller
    std::span<std::uint32_t> half_edge_by_b_;           // the direction a -> b, sorted by b
    std::span<std::uint32_t> half_edge_of_edge_;        // the direction a -> b, sorted by (a, b)
    std::span<std::uint32_t> edge_of_slot_;             // of two half edges, their place in edges_
};

}  // namespace stillmesh
