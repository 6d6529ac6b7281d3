// The matches of a frame, copied into one place with all that mesh, region and pose need: what was measured, what the
// map knows of each point, how unsure both are, and how much its past lets it count (method.md 7 and 11).
// Cost: one pass over the features.
#pragma once

#include <cstdint>

#include "engine/base/fixed_vector.hpp"
#include "engine/map/map.hpp"
#include "engine/matching/correspondence.hpp"
#include "engine/matching/map_matcher.hpp"
#include "engine/parameters.hpp"
#include "engine/static_region/static_region.hpp"
#include "engine/tracking/measured_frame.hpp"
#include "engine/tracking/noise_scale.hpp"

namespace stillmesh {

void gather_correspondences(const MapMatcher& matcher, const MeasuredFrame& frame, const Map& map,
                            const NoiseFactors& noise, const RegionContext& context, std::int64_t time_ns,
                            const Parameters& configuration, FixedVector<Correspondence>& out) noexcept;

}  // namespace stillmesh
