#include "engine/pose/agreeing.hpp"

#include "engine/pose/residual.hpp"

namespace stillmesh {

void choose_weighted(std::span<const Correspondence> correspondences, FixedVector<std::uint16_t>& chosen) noexcept {
    chosen.clear();
    for (std::size_t i = 0; i < correspondences.size(); ++i) {
        if (correspondences[i].weight > 0) STILLMESH_CHECK(chosen.push(static_cast<std::uint16_t>(i)));
    }
}

void choose_agreeing(std::span<const Correspondence> correspondences, const SE3& world_from_camera, double chi2_max,
                     double chi2_anchor_max, FixedVector<std::uint16_t>& chosen) noexcept {
    const SE3 camera_from_world = world_from_camera.inverse();
    chosen.clear();
    for (std::size_t i = 0; i < correspondences.size(); ++i) {
        const Correspondence& c = correspondences[i];
        if (c.weight > 0 && chi2_of(c, camera_from_world) <= chi2_max &&
            chi2_of_anchor(c, camera_from_world) <= chi2_anchor_max) {
            STILLMESH_CHECK(chosen.push(static_cast<std::uint16_t>(i)));
        }
    }
}

}  // namespace stillmesh
