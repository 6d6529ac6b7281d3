// Which correspondences have a weight, and which of these agree with a pose. Cost: one pass over them.
#pragma once

#include <cstdint>
#include <span>

#include "engine/base/fixed_vector.hpp"
#include "engine/matching/correspondence.hpp"

namespace stillmesh {

// Indices of those with a weight, ascending...
void choose_weighted(std::span<const Correspondence> correspondences, FixedVector<std::uint16_t>& chosen) noexcept;
// ... and agree with a pose: the squared Mahalanobis residual is at most `chi2_max` where the map has the point, and at
// most `chi2_anchor_max` where it was first seen.
void choose_agreeing(std::span<const Correspondence> correspondences, const SE3& world_from_camera, double chi2_max,
                     double chi2_anchor_max, FixedVector<std::uint16_t>& chosen) noexcept;

}  // namespace stillmesh
