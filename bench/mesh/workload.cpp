// Eight meshes of 1000 even points and nothing else: what instructions are counted on.
#include <cstdlib>

#include "engine/base/random.hpp"
#include "tests/mesh/rig.hpp"

int main() {
    using namespace stillmesh;
    testing::MeshRig rig(1000);
    for (std::uint64_t seed = 0; seed < 8; ++seed) {
        Random random(seed);
        PixelPoint points[1000];
        for (PixelPoint& p : points) {
            p.x = static_cast<std::int32_t>(random.below(640 * kMeshUnitsPerPixel));
            p.y = static_cast<std::int32_t>(random.below(480 * kMeshUnitsPerPixel));
        }
        if (rig.delaunay.triangulate(points) != Status::kOk) std::abort();
    }
    return 0;
}
