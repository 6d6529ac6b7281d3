// Whom the mesh is measured against, with the inputs already in their own types. Neither writes out edges, adjacency
// and vertex numbers as ours does: the comparison is in their favour.
#pragma once

#include "engine/base/check.hpp"  // before CGAL, which includes Eigen, whose asserts are our CHECKs

#include <CGAL/Delaunay_triangulation_2.h>
#include <CGAL/Exact_predicates_inexact_constructions_kernel.h>

#include <opencv2/imgproc.hpp>
#include <vector>

#include "bench/mesh/point_sets.hpp"

namespace stillmesh::bench {

// Exact predicates, floating-point coordinates: CGAL's fast choice. Inserting a range sorts it along a space-filling
// curve first.
class Cgal {
public:
    using Triangulation = CGAL::Delaunay_triangulation_2<CGAL::Exact_predicates_inexact_constructions_kernel>;
    explicit Cgal(const Points& points) {
        for (const PixelPoint p : points) points_.emplace_back(p.x, p.y);
    }
    std::size_t triangulate() const {
        Triangulation triangulation;
        triangulation.insert(points_.begin(), points_.end());
        return triangulation.number_of_faces();
    }

private:
    std::vector<Triangulation::Point> points_;
};

// Not exact: floats and tolerances.
class Subdiv2D {
public:
    explicit Subdiv2D(const Points& points) {
        for (const PixelPoint p : points) points_.emplace_back(static_cast<float>(p.x), static_cast<float>(p.y));
    }
    std::size_t triangulate() const {
        cv::Subdiv2D subdivision(cv::Rect(0, 0, kMeshCoordinateMax + 1, kMeshCoordinateMax + 1));
        subdivision.insert(points_);
        return points_.size();
    }

private:
    std::vector<cv::Point2f> points_;
};

}  // namespace stillmesh::bench
