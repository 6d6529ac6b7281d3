#pragma once

namespace stillmesh {

// Of inverse depth, 1/m: the Kinect's (Khoshelham & Elberink 2012), which a wrong depth unit scales along with the
// rest: so at least this share of what is usual in the view.
inline constexpr double kDepthNoise = 1.425e-3, kDepthNoiseShare = 4e-3;

}  // namespace stillmesh
