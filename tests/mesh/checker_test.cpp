// The checker must see what is wrong: every kind of damage to a good mesh is noticed.
#include <gtest/gtest.h>

#include <algorithm>
#include <functional>
#include <string>
#include <vector>

#include "engine/base/random.hpp"
#include "tests/mesh/mesh_checker.hpp"
#include "tests/mesh/rig.hpp"

namespace stillmesh::checker_test {
namespace {

// A mesh that can be changed.
struct Copy {
    explicit Copy(const Mesh& mesh)
        : vertices(mesh.vertices.begin(), mesh.vertices.end()),
          vertex_of_point(mesh.vertex_of_point.begin(), mesh.vertex_of_point.end()),
          edges(mesh.edges.begin(), mesh.edges.end()),
          triangles(mesh.triangles.begin(), mesh.triangles.end()) {}
    Mesh mesh() const { return {vertices, vertex_of_point, edges, triangles}; }
    std::vector<PixelPoint> vertices;
    std::vector<std::uint32_t> vertex_of_point;
    std::vector<MeshEdge> edges;
    std::vector<MeshTriangle> triangles;
};

// The other diagonal of a unit square, and of a quadrilateral whose circle test is strict: both well-formed meshes.
Mesh two_triangles(Copy& copy, bool is_along_02) {
    if (is_along_02) {
        copy.edges = {{0, 1, 0, kNoTriangle},
                      {0, 2, 1, 0},
                      {0, 3, kNoTriangle, 1},
                      {1, 2, 0, kNoTriangle},
                      {2, 3, 1, kNoTriangle}};
        copy.triangles = {{{0, 1, 2}, {0, 3, 1}}, {{0, 2, 3}, {1, 4, 2}}};
    } else {
        copy.edges = {{0, 1, 0, kNoTriangle},
                      {0, 3, kNoTriangle, 0},
                      {1, 2, 1, kNoTriangle},
                      {1, 3, 0, 1},
                      {2, 3, 1, kNoTriangle}};
        copy.triangles = {{{0, 1, 3}, {0, 3, 1}}, {{1, 2, 3}, {2, 4, 3}}};
    }
    return copy.mesh();
}

// Promise: the wrong diagonal is not Delaunay, or breaks the tie rule, even where nothing else is wrong.
TEST(MeshChecker, SeesTheWrongDiagonal) {
    testing::MeshRig rig(4);
    const std::vector<PixelPoint> square = {{0, 0}, {8, 0}, {8, 8}, {0, 8}};
    ASSERT_EQ(rig.delaunay.triangulate(square), Status::kOk);
    Copy copy(rig.delaunay.mesh());
    EXPECT_EQ(mesh_checker::check_mesh(square, Status::kOk, two_triangles(copy, true)), "");
    EXPECT_NE(mesh_checker::check_mesh(square, Status::kOk, two_triangles(copy, false), 0).find("tie rule"),
              std::string::npos);
    EXPECT_NE(mesh_checker::check_mesh(square, Status::kOk, two_triangles(copy, false)), "");

    const std::vector<PixelPoint> long_one = {{0, 4}, {8, 0}, {16, 4}, {8, 7}};
    ASSERT_EQ(rig.delaunay.triangulate(long_one), Status::kOk);
    copy = Copy(rig.delaunay.mesh());
    EXPECT_EQ(mesh_checker::check_mesh(long_one, Status::kOk, two_triangles(copy, false)), "");
    EXPECT_NE(mesh_checker::check_mesh(long_one, Status::kOk, two_triangles(copy, true), 0).find("not Delaunay"),
              std::string::npos);
}

// Promise: any single number changed anywhere in a mesh is noticed.
TEST(MeshChecker, SeesEveryChangedNumber) {
    testing::MeshRig rig(30);
    Random random(1);
    std::vector<PixelPoint> points;
    for (int i = 0; i < 30; ++i) {
        points.push_back({static_cast<std::int32_t>(random.below(12)), static_cast<std::int32_t>(random.below(12))});
    }
    ASSERT_EQ(rig.delaunay.triangulate(points), Status::kOk);
    const Copy good(rig.delaunay.mesh());
    ASSERT_EQ(mesh_checker::check_mesh(points, Status::kOk, good.mesh()), "");
    EXPECT_NE(mesh_checker::check_mesh(points, Status::kDegenerate, good.mesh()), "");

    const auto expect_seen = [&](const std::function<std::uint32_t&(Copy&)>& number, const std::string& what) {
        for (const std::uint32_t change : {1U, 2U, 7U, 0x80000000U}) {
            Copy bad = good;
            number(bad) += change;
            EXPECT_NE(mesh_checker::check_mesh(points, Status::kOk, bad.mesh()), "") << what << " + " << change;
        }
    };
    for (std::size_t i = 0; i < good.vertex_of_point.size(); ++i) {
        expect_seen([i](Copy& c) -> std::uint32_t& { return c.vertex_of_point[i]; }, "vertex of point");
    }
    for (std::size_t i = 0; i < good.edges.size(); ++i) {
        expect_seen([i](Copy& c) -> std::uint32_t& { return c.edges[i].a; }, "edge.a");
        expect_seen([i](Copy& c) -> std::uint32_t& { return c.edges[i].b; }, "edge.b");
        expect_seen([i](Copy& c) -> std::uint32_t& { return c.edges[i].left_triangle; }, "edge.left");
        expect_seen([i](Copy& c) -> std::uint32_t& { return c.edges[i].right_triangle; }, "edge.right");
    }
    for (std::size_t i = 0; i < good.triangles.size(); ++i) {
        for (std::size_t k = 0; k < 3; ++k) {
            expect_seen([i, k](Copy& c) -> std::uint32_t& { return c.triangles[i].vertex[k]; }, "triangle.vertex");
            expect_seen([i, k](Copy& c) -> std::uint32_t& { return c.triangles[i].edge[k]; }, "triangle.edge");
        }
    }
    Copy bad = good;
    bad.triangles.pop_back();
    EXPECT_NE(mesh_checker::check_mesh(points, Status::kOk, bad.mesh()), "");
    bad = good;
    bad.edges.pop_back();
    EXPECT_NE(mesh_checker::check_mesh(points, Status::kOk, bad.mesh()), "");
    bad = good;
    ++bad.vertices[3].x;
    EXPECT_NE(mesh_checker::check_mesh(points, Status::kOk, bad.mesh()), "");
}

}  // namespace
}  // namespace stillmesh::checker_test
