// Guibas & Stolfi's divide and conquer, bottom-up. The points are cut into about sqrt(n) / 2 vertical strips and each
// strip is triangulated by merging upwards, then the strips are merged sideways (Dwyer 1987): pieces stay compact, so a
// merge touches few edges, and for evenly spread points the merges cost O(n) together; never more than O(n log n).
//
// Ties. Four points on one circle allow two diagonals. The mesh is the Delaunay triangulation of the points with their
// lifts x^2 + y^2 lowered by infinitesimal amounts, the first point by (x, y) the most: a polygon of cocircular points
// becomes a fan around its first corner by (x, y). That is a property of the set of points, so the mesh is unique: it
// depends neither on the order of the input nor on where the cuts fall, and every predicate stays consistent.
#include "engine/mesh/delaunay.hpp"

#include <algorithm>

#include "engine/base/check.hpp"
#include "engine/mesh/predicates.hpp"

namespace stillmesh {
namespace {

constexpr std::uint32_t kNone = 0xffffffffU;
constexpr std::uint32_t kXBits = 14;
constexpr std::uint32_t kXMask = (1U << kXBits) - 1;
static_assert(kMeshCoordinateMax == static_cast<std::int32_t>(kXMask));
constexpr std::uint32_t kColumnShift = 5;  // 16384 / 512 columns
constexpr std::uint32_t kStripFactor = 2;  // points in a strip, in square roots of all: measured, docs/decisions.md

// A piece of the triangulation, by its hull: what a merge needs to know of it.
struct Piece {
    std::uint32_t first;  // hull edge, counter-clockwise, out of the first point in the order of the cut
    std::uint32_t last;   // hull edge, clockwise, out of the last point in the order of the cut
};

[[nodiscard]] constexpr std::uint32_t square_root(std::uint32_t n) noexcept {
    std::uint32_t root = 0;
    while ((root + 1) * (root + 1) <= n) ++root;  // n are the features of a picture: some sixty steps
    return root;
}

}  // namespace

// A plane graph as rings of half edges around their origins. At every moment of the merges it is plane, so it never
// holds more than mesh_edges_max(n) edges; removed ones are used again, last first.
class Delaunay::Subdivision {
public:
    explicit Subdivision(std::span<HalfEdge> storage) noexcept
        : edges_(storage.data()), capacity_(static_cast<std::uint32_t>(storage.size())) {}

    [[nodiscard]] static constexpr std::uint32_t twin(std::uint32_t e) noexcept { return e ^ 1U; }
    [[nodiscard]] std::uint32_t next(std::uint32_t e) const noexcept { return edges_[e].next; }
    [[nodiscard]] std::uint32_t previous(std::uint32_t e) const noexcept { return edges_[e].previous; }
    [[nodiscard]] std::uint32_t origin(std::uint32_t e) const noexcept { return edges_[e].origin; }
    [[nodiscard]] std::uint32_t destination(std::uint32_t e) const noexcept { return edges_[twin(e)].origin; }
    [[nodiscard]] PixelPoint at_origin(std::uint32_t e) const noexcept { return {edges_[e].x, edges_[e].y}; }
    [[nodiscard]] PixelPoint at_destination(std::uint32_t e) const noexcept { return at_origin(twin(e)); }
    // Around the face on the left, and around the face on the right.
    [[nodiscard]] std::uint32_t left_next(std::uint32_t e) const noexcept { return previous(twin(e)); }
    [[nodiscard]] std::uint32_t right_previous(std::uint32_t e) const noexcept { return next(twin(e)); }

    // None is free after a merge: an edge that goes lets a point in beside the gap, which gets a cross edge later.
    [[nodiscard]] std::uint32_t slots_used() const noexcept {
        STILLMESH_CHECK(free_ == kNone);
        return used_;
    }

    // Two or three points in the order of the cut.
    [[nodiscard]] Piece make_pair(const std::uint32_t* v, const PixelPoint* at) noexcept {
        const std::uint32_t e = take();
        set_origin(e, v[0], at[v[0]]);
        set_origin(twin(e), v[1], at[v[1]]);
        make_ring(e);
        make_ring(twin(e));
        return {e, twin(e)};
    }
    [[nodiscard]] Piece make_three(const std::uint32_t* v, const PixelPoint* at) noexcept {
        const std::uint32_t a = make_pair(v, at).first;
        const std::uint32_t b = take();
        set_origin(b, v[1], at[v[1]]);
        set_origin(twin(b), v[2], at[v[2]]);
        insert_after(twin(a), b);
        make_ring(twin(b));
        const int turn = orient2d(at[v[0]], at[v[1]], at[v[2]]);
        if (turn == 0) return {a, twin(b)};
        const std::uint32_t c = connect(b, a);
        return turn > 0 ? Piece{a, twin(b)} : Piece{twin(c), c};
    }

    // Joins two pieces, every point of `low` before every point of `high` in the order of the cut. That order is the
    // one along some direction without ties; in the words below it runs from left to right, and up is to its left.
    [[nodiscard]] Piece merge(Piece low, Piece high) noexcept {
        std::uint32_t first = low.first, last = high.last;
        std::uint32_t left = low.last, right = high.first;
        // Walk down both hulls to their lower common tangent.
        for (;;) {
            if (orient2d(at_origin(left), at_destination(left), at_origin(right)) > 0) {
                left = left_next(left);
            } else if (orient2d(at_origin(right), at_destination(right), at_origin(left)) < 0) {
                right = right_previous(right);
            } else {
                break;
            }
        }
        std::uint32_t base = connect(twin(right), left);  // from right to left
        if (origin(left) == origin(first)) first = twin(base);
        if (origin(right) == origin(last)) last = base;

        // Rise: a circle through the base grows upwards until it meets a point; that point takes the next cross edge.
        // The candidates for it are the first edges above the base on either side; an edge whose neighbour is met
        // before its own tip would be crossed, and goes. Below the base the circle never holds a point.
        PixelPoint at_left = at_origin(left), at_right = at_origin(right);
        std::uint32_t candidate_left = next(twin(base)), candidate_right = previous(base);
        for (;;) {
            Sight tip_left = sight(at_left, at_right, at_destination(candidate_left));
            Sight tip_right = sight(at_left, at_right, at_destination(candidate_right));
            const bool is_left = tip_left.area > 0;
            const bool is_right = tip_right.area > 0;
            const auto clear_way = [&](std::uint32_t& candidate, Sight& tip, auto&& follower_of) noexcept {
                for (;;) {
                    const std::uint32_t follower = follower_of(candidate);
                    const Sight beyond = sight(at_left, at_right, at_destination(follower));
                    if (!is_inside(at_left, at_right, tip, beyond)) break;
                    remove(candidate);
                    candidate = follower;
                    tip = beyond;
                }
            };
            if (is_left) clear_way(candidate_left, tip_left, [this](std::uint32_t e) { return next(e); });
            if (is_right) clear_way(candidate_right, tip_right, [this](std::uint32_t e) { return previous(e); });
            bool takes_right = is_right;
            if (is_left && is_right) [[likely]] {
                takes_right = is_inside(at_left, at_right, tip_left, tip_right);
            } else if (!is_left && !is_right) {
                break;  // the base is the upper common tangent
            }
            // Written without a branch: which side it is, nobody can predict.
            const std::uint32_t from = takes_right ? candidate_right : twin(base);
            const std::uint32_t to = takes_right ? twin(base) : twin(candidate_left);
            const std::uint32_t beyond = takes_right ? previous(twin(candidate_right)) : next(twin(candidate_left));
            at_left = takes_right ? at_left : tip_left.from;
            at_right = takes_right ? tip_right.from : at_right;
            candidate_left = takes_right ? candidate_left : beyond;
            candidate_right = takes_right ? beyond : candidate_right;
            base = connect(from, to);
        }
        return {first, last};
    }

    // The same piece in the order by (x, y): its extreme points are found on its hull.
    [[nodiscard]] Piece turn_sideways(Piece piece) const noexcept {
        std::uint32_t first = piece.first, last = piece.first;
        for (std::uint32_t e = right_previous(piece.first); e != piece.first; e = right_previous(e)) {
            if (is_before(at_origin(e), at_origin(first))) first = e;
            if (is_before(at_origin(last), at_origin(e))) last = e;
        }
        return {first, previous(last)};
    }

private:
    [[nodiscard]] std::uint32_t take() noexcept {
        if (free_ != kNone) {
            const std::uint32_t e = free_;
            free_ = edges_[e].next;
            return e;
        }
        STILLMESH_CHECK(used_ < capacity_);
        const std::uint32_t e = used_;
        used_ += 2;
        return e;
    }
    void set_origin(std::uint32_t e, std::uint32_t vertex, PixelPoint at) noexcept {
        edges_[e].origin = vertex;
        edges_[e].x = static_cast<std::int16_t>(at.x);
        edges_[e].y = static_cast<std::int16_t>(at.y);
    }
    void make_ring(std::uint32_t e) noexcept { edges_[e].next = edges_[e].previous = e; }
    void insert_after(std::uint32_t place, std::uint32_t e) noexcept {
        const std::uint32_t follower = edges_[place].next;
        edges_[e].next = follower;
        edges_[e].previous = place;
        edges_[follower].previous = e;
        edges_[place].next = e;
    }
    // A new edge from the destination of `a` to the origin of `b`, across the face on the left of both.
    [[nodiscard]] std::uint32_t connect(std::uint32_t a, std::uint32_t b) noexcept {
        const std::uint32_t e = take();
        edges_[e] = edges_[twin(a)];
        edges_[twin(e)] = edges_[b];
        insert_after(left_next(a), e);
        insert_after(b, twin(e));
        return e;
    }
    void remove(std::uint32_t e) noexcept {
        leave_ring(e);
        leave_ring(twin(e));
        e &= ~1U;
        edges_[e].next = free_;
        free_ = e;
    }
    void leave_ring(std::uint32_t e) noexcept {
        const HalfEdge leaving = edges_[e];
        edges_[leaving.previous].next = leaving.next;
        edges_[leaving.next].previous = leaving.previous;
    }

    HalfEdge* edges_;
    std::uint32_t capacity_;
    std::uint32_t used_ = 0;
    std::uint32_t free_ = kNone;
};

void Delaunay::create(Arena& arena, std::uint32_t points_max) noexcept {
    points_max_ = points_max;
    take_arrays(arena, points_max);
}

Status Delaunay::triangulate(std::span<const PixelPoint> points) noexcept {
    mesh_ = Mesh{};
    if (points.size() > points_max_) return Status::kFull;
    std::uint32_t bits = 0;
    for (const PixelPoint p : points) bits |= static_cast<std::uint32_t>(p.x) | static_cast<std::uint32_t>(p.y);
    if ((bits & ~kXMask) != 0) return Status::kInvalid;

    sort_and_number(points);
    mesh_.vertices = vertices_.first(vertices_count_);
    mesh_.vertex_of_point = vertex_of_point_.first(points.size());
    if (vertices_count_ < 2) return Status::kDegenerate;

    const std::uint32_t strips_count = cut_into_strips();
    Subdivision subdivision(half_edges_);
    // Binary counters of pieces: after the i-th piece, as many merges as i has trailing zero bits; after the
    // last, all that are left.
    Piece strips[kLevelsMax];
    std::uint32_t strips_top = 0;
    for (std::uint32_t s = 0; s < strips_count; ++s) {
        Piece pieces[kLevelsMax];
        std::uint32_t pieces_top = 0;
        std::uint32_t at = strip_begin_[s];
        const std::uint32_t end = strip_begin_[s + 1];
        for (std::uint32_t made = 1; at < end; ++made) {
            const std::uint32_t left = end - at;
            const bool is_pair = left == 2 || left == 4;
            pieces[pieces_top++] = is_pair ? subdivision.make_pair(&order_[at], vertices_.data())
                                           : subdivision.make_three(&order_[at], vertices_.data());
            at += is_pair ? 2 : 3;
            for (std::uint32_t i = made; pieces_top > 1 && (i % 2 == 0 || at == end); i /= 2) {
                --pieces_top;
                pieces[pieces_top - 1] = subdivision.merge(pieces[pieces_top - 1], pieces[pieces_top]);
            }
        }
        strips[strips_top++] = strips_count > 1 ? subdivision.turn_sideways(pieces[0]) : pieces[0];
        for (std::uint32_t i = s + 1; strips_top > 1 && (i % 2 == 0 || s + 1 == strips_count); i /= 2) {
            --strips_top;
            strips[strips_top - 1] = subdivision.merge(strips[strips_top - 1], strips[strips_top]);
        }
    }
    write_out(subdivision);
    return mesh_.triangles.empty() ? Status::kDegenerate : Status::kOk;
}

// Radix sort by (y, x), stable, then number the distinct points in order of first appearance.
void Delaunay::sort_and_number(std::span<const PixelPoint> points) noexcept {
    const auto count = static_cast<std::uint32_t>(points.size());
    constexpr std::uint32_t kShift[3] = {0, 10, 19};
    constexpr std::uint32_t kRange[3] = {1024, 512, 512};
    std::uint32_t* const digits[3] = {&counts_[0], &counts_[1024], &counts_[1024 + 512]};
    std::uint64_t* from = keys_.data();
    std::uint64_t* to = keys_other_.data();

    std::fill(counts_.begin(), counts_.end(), 0U);
    for (std::uint32_t i = 0; i < count; ++i) {
        const std::uint32_t key =
            static_cast<std::uint32_t>(points[i].y) << kXBits | static_cast<std::uint32_t>(points[i].x);
        from[i] = static_cast<std::uint64_t>(key) << 32 | i;
        for (int pass = 0; pass < 3; ++pass) ++digits[pass][(key >> kShift[pass]) & (kRange[pass] - 1)];
    }
    for (int pass = 0; pass < 3; ++pass) {
        std::uint32_t begin = 0;
        for (std::uint32_t digit = 0; digit < kRange[pass]; ++digit) {
            const std::uint32_t size = digits[pass][digit];
            digits[pass][digit] = begin;
            begin += size;
        }
        for (std::uint32_t i = 0; i < count; ++i) {
            const std::uint64_t key = from[i];
            to[digits[pass][(key >> (32 + kShift[pass])) & (kRange[pass] - 1)]++] = key;
        }
        std::swap(from, to);
    }
    sorted_ = from;

    // A point's first equal is the smallest index in its run, because the sort is stable.
    std::uint32_t first = 0;
    for (std::uint32_t i = 0; i < count; ++i) {
        const auto index = static_cast<std::uint32_t>(from[i]);
        if (i == 0 || (from[i] ^ from[i - 1]) >> 32 != 0) first = index;
        vertex_of_point_[index] = first;
    }
    vertices_count_ = 0;
    for (std::uint32_t i = 0; i < count; ++i) {
        if (vertex_of_point_[i] == i) {
            vertices_[vertices_count_] = points[i];
            vertex_of_point_[i] = vertices_count_++;
        } else {
            vertex_of_point_[i] = vertex_of_point_[vertex_of_point_[i]];
        }
    }
}

// Fills order_ and strip_begin_; returns how many strips. Whole columns go to a strip until it holds enough points: it
// follows clusters, never splits equal x, and no strip has fewer than two points.
std::uint32_t Delaunay::cut_into_strips() noexcept {
    const std::uint32_t n = vertices_count_;
    const std::uint32_t strip_points_min = std::max(kStripFactor * square_root(n), 2U);
    std::uint32_t* const strip_of_column = counts_.data();
    std::fill_n(strip_of_column, kColumns, 0U);
    for (std::uint32_t v = 0; v < n; ++v) ++strip_of_column[vertices_[v].x >> kColumnShift];
    std::uint32_t strips_count = 0, begin = 0, end = 0;
    for (std::uint32_t column = 0; column < kColumns; ++column) {
        end += strip_of_column[column];
        strip_of_column[column] = strips_count;
        if (end - begin >= strip_points_min && n - end >= strip_points_min) {
            strip_begin_[strips_count++] = begin;
            begin = end;
        }
    }
    strip_begin_[strips_count++] = begin;
    strip_begin_[strips_count] = n;

    // Deal the sorted points out; next[s] runs through strip s, and ends where strip s + 1 begins.
    std::uint32_t* const next = counts_.data() + kColumns;
    std::copy_n(strip_begin_.begin(), strips_count, next);
    std::uint32_t seen = 0;
    for (std::uint32_t i = 0; seen < n; ++i) {
        if (i > 0 && (sorted_[i] ^ sorted_[i - 1]) >> 32 == 0) continue;
        ++seen;
        const std::uint32_t x = static_cast<std::uint32_t>(sorted_[i] >> 32) & kXMask;
        order_[next[strip_of_column[x >> kColumnShift]]++] = vertex_of_point_[static_cast<std::uint32_t>(sorted_[i])];
    }
    return strips_count;
}

// The edges are sorted by counting, by their larger vertex and then by their smaller; the triangles follow in order
// from the edges. Straight loops: a branch on which of two vertices is smaller would be mispredicted every other time.
void Delaunay::write_out(const Subdivision& subdivision) noexcept {
    const std::uint32_t n = vertices_count_;
    const std::uint32_t edges_count = subdivision.slots_used() / 2;
    std::uint32_t* const begin_by_b = begin_by_b_.data();
    std::uint32_t* const begin_by_a = begin_by_a_.data();
    std::uint32_t* const half_edge_of_edge = half_edge_of_edge_.data();
    std::uint32_t* const unsorted = half_edge_of_edge;
    std::fill_n(begin_by_b, n, 0U);
    std::fill_n(begin_by_a, n, 0U);
    for (std::uint32_t e = 0; e < 2 * edges_count; e += 2) {
        const std::uint32_t ab = e + static_cast<std::uint32_t>(subdivision.origin(e) > subdivision.destination(e));
        ++begin_by_a[subdivision.origin(ab)];
        ++begin_by_b[subdivision.destination(ab)];
        unsorted[e / 2] = ab;
    }
    for (std::uint32_t v = 0, sum_a = 0, sum_b = 0; v < n; ++v) {
        const std::uint32_t count_a = begin_by_a[v], count_b = begin_by_b[v];
        begin_by_a[v] = sum_a;
        begin_by_b[v] = sum_b;
        sum_a += count_a;
        sum_b += count_b;
    }
    std::uint32_t* const by_b = half_edge_by_b_.data();
    for (std::uint32_t i = 0; i < edges_count; ++i) {
        by_b[begin_by_b[subdivision.destination(unsorted[i])]++] = unsorted[i];
    }
    MeshEdge* const edges = edges_.data();
    std::uint32_t* const edge_of_slot = edge_of_slot_.data();
    for (std::uint32_t i = 0; i < edges_count; ++i) {
        const std::uint32_t ab = by_b[i];
        const std::uint32_t a = subdivision.origin(ab);
        const std::uint32_t edge = begin_by_a[a]++;
        edges[edge] = MeshEdge{a, subdivision.destination(ab), kNoTriangle, kNoTriangle};
        half_edge_of_edge[edge] = ab;
        edge_of_slot[ab / 2] = edge;
    }

    // A triangle is written by the edge that leaves its smallest vertex counter-clockwise, so in sorted order too. On
    // the outer face the third point lies to the right of a hull edge, or on its line. What is written for an edge that
    // writes no triangle is overwritten by the next; the array has one place more for the last.
    MeshTriangle* const triangles = triangles_.data();
    std::uint32_t triangles_count = 0;
    for (std::uint32_t edge = 0; edge < edges_count; ++edge) {
        const std::uint32_t ab = half_edge_of_edge[edge];
        const std::uint32_t ac = subdivision.next(ab);
        const std::uint32_t a = edges[edge].a, b = edges[edge].b, c = subdivision.destination(ac);
        const std::int32_t area =
            twice_area(subdivision.at_origin(ab), subdivision.at_destination(ab), subdivision.at_destination(ac));
        triangles[triangles_count] =
            MeshTriangle{{a, b, c}, {edge, edge_of_slot[subdivision.left_next(ab) / 2], edge_of_slot[ac / 2]}};
        triangles_count += static_cast<std::uint32_t>(c > a) & static_cast<std::uint32_t>(area > 0);
    }
    for (std::uint32_t t = 0; t < triangles_count; ++t) {
        const MeshTriangle& triangle = triangles[t];
        MeshEdge& bc = edges[triangle.edge[1]];
        edges[triangle.edge[0]].left_triangle = t;
        edges[triangle.edge[2]].right_triangle = t;
        const std::uint32_t is_left = 0U - static_cast<std::uint32_t>(triangle.vertex[1] < triangle.vertex[2]);
        bc.left_triangle = (bc.left_triangle & ~is_left) | (t & is_left);
        bc.right_triangle = (bc.right_triangle & is_left) | (t & ~is_left);
    }
    mesh_.edges = edges_.first(edges_count);
    mesh_.triangles = triangles_.first(triangles_count);
}

}  // namespace stillmesh
