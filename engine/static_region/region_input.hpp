// What the static region is chosen from. Borrowed: all of it outlives the choice.
#pragma once

#include <cstdint>
#include <span>

#include "engine/base/fixed_vector.hpp"
#include "engine/matching/correspondence.hpp"
#include "engine/parameters.hpp"
#include "engine/static_region/mesh_groups.hpp"
#include "engine/static_region/region_context.hpp"

namespace stillmesh {

struct RegionInput {
    std::span<const Correspondence> correspondences;
    std::span<const std::uint16_t> weighted;  // those with a weight, ascending
    const MeshGroups& groups;
    const Parameters& configuration;
    const RegionContext& context;
    FixedVector<std::uint16_t>& scratch;  // room for all correspondences; every step overwrites it
};

}  // namespace stillmesh
