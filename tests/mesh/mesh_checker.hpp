// Proves that a mesh is the Delaunay triangulation of its points, with arithmetic of its own (128-bit, no predicate of
// the engine). Why this is a proof: every triangle turns counter-clockwise, neighbours agree about their common edge,
// the boundary is the convex hull, the areas add up to the hull's, and V - E + F = 2: so the triangles tile the hull.
// A tiling in which every inner edge passes the circle test is Delaunay everywhere (Delaunay 1934); among equals the
// tie rule of delaunay.cpp is checked edge by edge. Small sets are also compared with brute force over all triples.
// For tests and fuzzers only: uses the heap.
#pragma once

#include <algorithm>
#include <array>
#include <cstdint>
#include <map>
#include <numeric>
#include <span>
#include <string>
#include <utility>
#include <vector>

#include "engine/mesh/delaunay.hpp"
#include "engine/mesh/pixel_point.hpp"
#include "tests/mesh/wide.hpp"

namespace stillmesh::mesh_checker {

using Point = std::pair<std::int64_t, std::int64_t>;  // compares by x, then by y

inline Point point_of(PixelPoint p) {
    return {p.x, p.y};
}

inline Wide area2(Point a, Point b, Point c) {
    return Wide(b.first - a.first) * (c.second - a.second) - Wide(b.second - a.second) * (c.first - a.first);
}
inline int sign(Wide value) {
    return (value > 0) - (value < 0);
}

// Positive: d inside the circle of a, b, c (counter-clockwise). The 4x4 determinant on absolute coordinates, expanded
// along the lifts: another formula than the engine's.
inline int circle(Point a, Point b, Point c, Point d) {
    const auto lift = [](Point p) { return Wide(p.first) * p.first + Wide(p.second) * p.second; };
    return sign(lift(a) * area2(b, c, d) - lift(b) * area2(a, c, d) + lift(c) * area2(a, b, d) -
                lift(d) * area2(a, b, c));
}

// The hull, counter-clockwise from its first point, with the points that lie on its sides.
inline std::vector<Point> hull_of(std::vector<Point> points) {
    std::sort(points.begin(), points.end());
    std::vector<Point> hull;
    const auto add = [&hull](Point p, std::size_t floor) {
        while (hull.size() >= floor + 2 && area2(hull[hull.size() - 2], hull.back(), p) < 0) hull.pop_back();
        hull.push_back(p);
    };
    for (const Point& p : points) add(p, 0);
    const std::size_t floor = hull.size() - 1;
    for (std::size_t i = points.size() - 1; i-- > 0;) add(points[i], floor);
    hull.pop_back();
    return hull;
}

// All triangles of the tie-free Delaunay triangulation, by definition: for every three points whose circle is empty,
// the points on it form a polygon; it is a fan around its first point.
inline std::vector<std::array<std::uint32_t, 3>> brute_force(const std::vector<Point>& points) {
    std::vector<std::array<std::uint32_t, 3>> triangles;
    const auto n = static_cast<std::uint32_t>(points.size());
    std::vector<Point> ring;
    for (std::uint32_t i = 0; i < n; ++i) {
        for (std::uint32_t j = i + 1; j < n; ++j) {
            for (std::uint32_t k = j + 1; k < n; ++k) {
                const int turn = sign(area2(points[i], points[j], points[k]));
                if (turn == 0) continue;
                const std::uint32_t a = i, b = turn > 0 ? j : k, c = turn > 0 ? k : j;
                bool is_empty = true;
                Point first = std::min({points[a], points[b], points[c]});
                ring.clear();
                for (std::uint32_t d = 0; d < n && is_empty; ++d) {
                    const int where = circle(points[a], points[b], points[c], points[d]);
                    is_empty = where <= 0;
                    if (where == 0) {
                        ring.push_back(points[d]);
                        first = std::min(first, points[d]);
                    }
                }
                if (!is_empty) continue;
                const std::array<Point, 3> corner = {points[a], points[b], points[c]};
                const auto at = std::find(corner.begin(), corner.end(), first);
                if (at == corner.end()) continue;
                // A side of the polygon lies opposite: nothing of the ring beyond it.
                const auto turned = static_cast<std::size_t>(at - corner.begin());
                const Point p = corner[(turned + 1) % 3], q = corner[(turned + 2) % 3];
                if (std::any_of(ring.begin(), ring.end(), [&](Point r) { return area2(p, q, r) < 0; })) continue;
                triangles.push_back({a, b, c});
            }
        }
    }
    std::sort(triangles.begin(), triangles.end());
    return triangles;
}

// Empty when everything holds, else a sentence about the first thing that does not. `brute_force_max`: sets of up to
// so many distinct points are compared with brute force, O(n^4).
inline std::string check_mesh(std::span<const PixelPoint> input, Status status, const Mesh& mesh,
                              std::uint32_t brute_force_max = 12) {
    const auto fail = [](const std::string& what, std::size_t where) { return what + " at " + std::to_string(where); };

    // The vertices are the distinct points in order of first appearance.
    std::map<Point, std::uint32_t> vertex_at;
    if (mesh.vertex_of_point.size() != input.size()) return "vertex_of_point has the wrong size";
    std::vector<Point> points;
    for (std::size_t i = 0; i < input.size(); ++i) {
        const auto [entry, is_new] =
            vertex_at.try_emplace(point_of(input[i]), static_cast<std::uint32_t>(points.size()));
        if (is_new) points.push_back(point_of(input[i]));
        if (mesh.vertex_of_point[i] != entry->second) return fail("wrong vertex_of_point", i);
    }
    const auto n = static_cast<std::uint32_t>(points.size());
    if (mesh.vertices.size() != n) return "wrong number of vertices";
    for (std::uint32_t v = 0; v < n; ++v) {
        if (point_of(mesh.vertices[v]) != points[v]) return fail("wrong vertex", v);
    }

    // Edges and triangles are sorted, and name each other rightly.
    const std::size_t edges_count = mesh.edges.size(), triangles_count = mesh.triangles.size();
    if (edges_count > mesh_edges_max(n)) return "too many edges";
    if (triangles_count > mesh_triangles_max(n)) return "too many triangles";
    for (std::size_t e = 0; e < edges_count; ++e) {
        const MeshEdge& edge = mesh.edges[e];
        if (edge.a >= edge.b || edge.b >= n) return fail("edge without two vertices in order", e);
        if (e > 0 && !(std::pair(mesh.edges[e - 1].a, mesh.edges[e - 1].b) < std::pair(edge.a, edge.b))) {
            return fail("edges out of order", e);
        }
    }
    Wide area_sum = 0;
    std::size_t sides = 0;
    std::vector<std::array<std::uint32_t, 3>> found;
    for (std::size_t t = 0; t < triangles_count; ++t) {
        const MeshTriangle& triangle = mesh.triangles[t];
        const std::uint32_t* const v = triangle.vertex;
        if (v[0] >= n || v[1] >= n || v[2] >= n) return fail("triangle with a vertex that does not exist", t);
        if (v[0] >= v[1] || v[0] >= v[2]) return fail("triangle does not begin with its smallest vertex", t);
        const Wide area = area2(points[v[0]], points[v[1]], points[v[2]]);
        if (area <= 0) return fail("triangle is not counter-clockwise", t);
        area_sum += area;
        found.push_back({v[0], v[1], v[2]});
        if (t > 0 && !(found[t - 1] < found[t])) return fail("triangles out of order", t);
        for (std::size_t k = 0; k < 3; ++k) {
            const std::uint32_t from = v[k], to = v[(k + 1) % 3];
            if (triangle.edge[k] >= edges_count) return fail("triangle with an edge that does not exist", t);
            const MeshEdge& edge = mesh.edges[triangle.edge[k]];
            if (edge.a != std::min(from, to) || edge.b != std::max(from, to)) return fail("wrong edge of triangle", t);
            if ((from < to ? edge.left_triangle : edge.right_triangle) != t) return fail("edge forgets triangle", t);
            ++sides;
        }
    }
    std::size_t named = 0;
    for (const MeshEdge& edge : mesh.edges) {
        for (const std::uint32_t t : {edge.left_triangle, edge.right_triangle}) {
            if (t != kNoTriangle) ++named;
            if (t != kNoTriangle && t >= triangles_count) return "edge with a triangle that does not exist";
        }
    }
    if (named != sides) return "edges and triangles do not name each other one to one";

    // All on one line, or fewer than three: neighbours are joined, and that is all.
    std::vector<Point> sorted = points;
    std::sort(sorted.begin(), sorted.end());
    const bool is_degenerate = n < 3 || std::all_of(sorted.begin(), sorted.end(),
                                                    [&](Point p) { return area2(sorted[0], sorted[1], p) == 0; });
    if (status != (is_degenerate ? Status::kDegenerate : Status::kOk)) return "wrong status";
    if (is_degenerate) {
        if (triangles_count != 0) return "triangles on a line";
        std::vector<std::pair<std::uint32_t, std::uint32_t>> expected;
        for (std::size_t i = 1; i < n; ++i) {
            expected.push_back(std::minmax({vertex_at[sorted[i - 1]], vertex_at[sorted[i]]}));
        }
        std::sort(expected.begin(), expected.end());
        if (edges_count != expected.size()) return "wrong number of edges on a line";
        for (std::size_t e = 0; e < edges_count; ++e) {
            if (std::pair(mesh.edges[e].a, mesh.edges[e].b) != expected[e]) return fail("wrong edge on a line", e);
        }
        return {};
    }

    // Connected, and Euler's formula with the outer face.
    std::vector<std::uint32_t> parent(n);
    std::iota(parent.begin(), parent.end(), 0U);
    const auto root = [&parent](std::uint32_t v) {
        while (parent[v] != v) v = parent[v] = parent[parent[v]];
        return v;
    };
    for (const MeshEdge& edge : mesh.edges) parent[root(edge.a)] = root(edge.b);
    for (std::uint32_t v = 0; v < n; ++v) {
        if (root(v) != root(0)) return fail("not connected", v);
    }
    if (n + triangles_count + 1 != edges_count + 2) return "Euler's formula fails";

    // The boundary is the hull, and the areas fill it.
    const std::vector<Point> hull = hull_of(points);
    Wide hull_area = 0;
    std::size_t boundary = 0;
    for (std::size_t i = 1; i + 1 < hull.size(); ++i) hull_area += area2(hull[0], hull[i], hull[i + 1]);
    for (const MeshEdge& edge : mesh.edges) {
        if (edge.left_triangle == kNoTriangle && edge.right_triangle == kNoTriangle) return "edge without a triangle";
        if (edge.left_triangle == kNoTriangle || edge.right_triangle == kNoTriangle) ++boundary;
    }
    if (boundary != hull.size()) return "the boundary is not the hull";
    for (std::size_t i = 0; i < hull.size(); ++i) {
        const std::uint32_t from = vertex_at[hull[i]], to = vertex_at[hull[(i + 1) % hull.size()]];
        const auto edge = std::lower_bound(mesh.edges.begin(), mesh.edges.end(), std::minmax(from, to),
                                           [](const MeshEdge& e, const auto& ends) {
                                               return std::pair(e.a, e.b) < std::pair(ends.first, ends.second);
                                           });
        if (edge == mesh.edges.end() || edge->a != std::min(from, to) || edge->b != std::max(from, to) ||
            (from < to ? edge->right_triangle : edge->left_triangle) != kNoTriangle) {
            return fail("hull edge missing", i);
        }
    }
    if (area_sum != hull_area) return "the areas do not add up to the hull's";

    // The circle test of every inner edge, and the tie rule.
    for (std::size_t e = 0; e < edges_count; ++e) {
        const MeshEdge& edge = mesh.edges[e];
        if (edge.left_triangle == kNoTriangle || edge.right_triangle == kNoTriangle) continue;
        const auto apex = [&](std::uint32_t t) {
            const std::uint32_t* const v = mesh.triangles[t].vertex;
            return points[v[0] + v[1] + v[2] - edge.a - edge.b];
        };
        const Point a = points[edge.a], b = points[edge.b];
        const Point left = apex(edge.left_triangle), right = apex(edge.right_triangle);
        const int where = circle(a, b, left, right);
        if (where > 0) return fail("not Delaunay: edge", e);
        if (where == 0) {
            const Point first = std::min({a, b, left, right});
            if (first != a && first != b) return fail("tie rule broken: edge", e);
        }
    }

    if (n <= brute_force_max && found != [&] {
            auto expected = brute_force(points);
            for (auto& t : expected) std::rotate(t.begin(), std::min_element(t.begin(), t.end()), t.end());
            std::sort(expected.begin(), expected.end());
            return expected;
        }()) {
        return "differs from brute force";
    }
    return {};
}

}  // namespace stillmesh::mesh_checker
