// What a turn of the camera counts for beside metres. Without Eigen: stores of regions outside the engine ask for it
// too.
#pragma once

namespace stillmesh {

// A turn by an angle a counts as 2 sqrt(1 - cos a) m: 10 degrees as .25 m, 60 as 1.4 m, which is what takes a view of a
// room as far out of sight.
inline constexpr double kTurn_m2 = 4.0;

}  // namespace stillmesh
