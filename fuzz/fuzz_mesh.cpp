// The mesh against its exact checker: any points, in any order, one set after the other through the same Delaunay.
#include <algorithm>
#include <vector>

#include "engine/mesh/delaunay.hpp"
#include "fuzz/fuzz.hpp"
#include "tests/mesh/mesh_checker.hpp"
#include "tests/mesh/rig.hpp"

namespace {

constexpr std::uint32_t kPointsMax = 200;

// First byte: how the points are written. Small grids make ties and duplicates, whole numbers reach the range's ends
// and beyond, steps make long rows.
std::vector<stillmesh::PixelPoint> points_from(stillmesh::fuzz::Bytes& bytes) {
    using stillmesh::PixelPoint;
    std::vector<PixelPoint> points;
    const std::uint8_t how = bytes.u8();
    const auto count = static_cast<std::uint32_t>(bytes.u8());  // 201 ... 255: too many
    const auto step = static_cast<std::int32_t>(1) << (how >> 2 & 15) % 11;
    PixelPoint at{static_cast<std::int32_t>(how >> 4) * 64, 100};
    while (points.size() < count && !bytes.is_empty()) {
        if (how % 4 == 0) {
            const std::uint8_t cell = bytes.u8();
            points.push_back({(cell & 15) * step, (cell >> 4) * step});
        } else if (how % 4 == 1) {
            const std::uint8_t x = bytes.u8();
            points.push_back({x * 64 + 63 * (how >> 7), bytes.u8() * 64 + 63 * (how >> 7)});
        } else if (how % 4 == 2) {
            const auto x = static_cast<std::int16_t>(bytes.u16());
            points.push_back({x, static_cast<std::int16_t>(bytes.u16())});
        } else {
            const std::uint8_t move = bytes.u8();
            at.x += (move & 15) - 4;
            at.y += (move >> 4) - 7;
            points.push_back(at);
        }
    }
    return points;
}

}  // namespace

extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size_bytes) {
    using namespace stillmesh;
    testing::MeshRig rig(kPointsMax);
    fuzz::Bytes bytes({data, size_bytes});
    while (!bytes.is_empty()) {
        std::vector<PixelPoint> points = points_from(bytes);
        Status expected = Status::kOk;
        for (const PixelPoint p : points) {
            if (std::min(p.x, p.y) < 0 || std::max(p.x, p.y) > kMeshCoordinateMax) expected = Status::kInvalid;
        }
        if (points.size() > kPointsMax) expected = Status::kFull;
        for (int turn = 0; turn < 2; ++turn) {
            const Status status = rig.delaunay.triangulate(points);
            const Mesh& mesh = rig.delaunay.mesh();
            if (expected == Status::kOk) {
                const std::string complaint = mesh_checker::check_mesh(points, status, mesh, 8);
                fuzz::expect(complaint.empty(), "a Delaunay mesh: " + complaint);
            } else {
                fuzz::expect(status == expected, "too many points are kFull, bad coordinates kInvalid");
                fuzz::expect(mesh.vertices.empty() && mesh.edges.empty() && mesh.triangles.empty() &&
                                 mesh.vertex_of_point.empty(),
                             "a refused set leaves an empty mesh");
            }
            std::reverse(points.begin(), points.end());
        }
    }
    return 0;
}
