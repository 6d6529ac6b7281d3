// Time of our triangulation as a share of CGAL's, on the same points, in the same run, on one thread. Both are measured
// in turn and the minimum per set is kept, so that what else the machine does falls out. Exit 1 when a share exceeds
// --max. cv::Subdiv2D is printed beside them: it is not exact, and no bar.
//   mesh_ratio [--max SHARE] [--repeat N]
#include <chrono>
#include <cstdio>
#include <cstdlib>
#include <cstring>

#include "bench/mesh/baselines.hpp"
#include "tests/mesh/rig.hpp"

namespace stillmesh::bench {
namespace {

double now_us() {
    return std::chrono::duration<double, std::micro>(std::chrono::steady_clock::now().time_since_epoch()).count();
}

double measure(const char* name, const std::vector<Points>& sets, int repeat) {
    testing::MeshRig rig(1000);
    double ours_us = 0, cgal_us = 0, subdiv_us = 0, points_count = 0;
    for (const Points& points : sets) {
        const Cgal cgal(points);
        const Subdiv2D subdiv(points);
        double ours_best = 1e9, cgal_best = 1e9, subdiv_best = 1e9;
        for (int i = 0; i < repeat; ++i) {
            const double a = now_us();
            if (rig.delaunay.triangulate(points) != Status::kOk) std::abort();
            const double b = now_us();
            if (cgal.triangulate() != rig.delaunay.mesh().triangles.size()) std::abort();
            const double c = now_us();
            if (subdiv.triangulate() == 0) std::abort();
            const double d = now_us();
            ours_best = std::min(ours_best, b - a);
            cgal_best = std::min(cgal_best, c - b);
            subdiv_best = std::min(subdiv_best, d - c);
        }
        ours_us += ours_best;
        cgal_us += cgal_best;
        subdiv_us += subdiv_best;
        points_count += static_cast<double>(points.size());
    }
    const double sets_count = static_cast<double>(sets.size());
    std::printf(
        "%-10s %5.0f points  stillmesh %7.1f us  CGAL %7.1f us  share %.3f  cv::Subdiv2D %7.1f us  share %.3f\n", name,
        points_count / sets_count, ours_us / sets_count, cgal_us / sets_count, ours_us / cgal_us,
        subdiv_us / sets_count, ours_us / subdiv_us);
    return ours_us / cgal_us;
}

}  // namespace
}  // namespace stillmesh::bench

int main(int argc, char** argv) {
    using namespace stillmesh::bench;
    double share_max = 1e9;
    int repeat = 50;
    for (int i = 1; i + 1 < argc; i += 2) {
        if (std::strcmp(argv[i], "--max") == 0) share_max = std::atof(argv[i + 1]);
        if (std::strcmp(argv[i], "--repeat") == 0) repeat = std::atoi(argv[i + 1]);
    }
    std::vector<Points> even, clustered;
    for (std::uint64_t seed = 0; seed < 8; ++seed) {
        even.push_back(even_points(1000, seed));
        clustered.push_back(clustered_points(1000, seed));
    }
    const double worst = std::max({measure("even", even, repeat), measure("clustered", clustered, repeat),
                                   measure("features", feature_points(8), repeat)});
    std::printf("worst share %.3f (at most %.2f)\n", worst, share_max);
    return worst <= share_max ? 0 : 1;
}
