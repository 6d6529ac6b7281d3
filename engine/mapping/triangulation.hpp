// A point for a feature without depth, from two keyframes that show it (paper 2.1): the feature of the other keyframe
// that lies near the epipolar line and looks alike, where the two rays meet, and how well that is known by the
// parallax. Cost: a unit for 32 features of the other keyframe, and for 32 descriptors compared.
#pragma once

#include <cstdint>

#include "engine/geometry/pixel_noise.hpp"
#include "engine/map/map.hpp"
#include "engine/parameters.hpp"

namespace stillmesh {

struct Triangulation {
    Handle<MapPoint> point;  // null: none was added
    std::uint32_t units = 0;
};

// Of a `feature` of the keyframe `here`, neither of whose keyframes has gone. Both observe the point that is added.
[[nodiscard]] Triangulation triangulate(Map& map, Handle<Keyframe> here, std::uint32_t feature, Handle<Keyframe> other,
                                        const Parameters& configuration, const PixelNoise& pixel_noise) noexcept;

}  // namespace stillmesh
